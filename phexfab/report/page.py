"""The report: one HTML file with pictures, views, checks, charts and sheets, for any browser.

Nothing in it is loaded from elsewhere: style, script, geometry and pictures stand in the file, and
a content policy in its head forbids the rest.
"""

from __future__ import annotations

from html import escape
from importlib import resources
from os import PathLike

import numpy as np

from phexfab.fabrication.parts import Beam, CheckResult, Panel
from phexfab.report.charts import histogram
from phexfab.report.data import ReportData
from phexfab.report.drawings import sheet_drawing
from phexfab.report.fields import RAMP, panel_fields, shell_view
from phexfab.report.figures import gauss_figure, shell_figure
from phexfab.report.pack import page_data
from phexfab.report.stage import image, stage
from phexfab.report.summary import key_figures, materials_table
from phexfab.report.text import label, number, quantity
from phexfab.whole import whole

_SCRIPTS = ("payload.js", "shaders.js", "drawing.js", "view.js", "stage.js")
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


def write_report(data: ReportData, path: str | PathLike[str]) -> None:
    """Write the report as one self-contained HTML file; the same data gives the same bytes.

    The file appears whole or not at all.

    Parameters
    ----------
    data : ReportData
    path : path
        The file to write.
    """
    text = report_html(data)
    with whole(path) as draft:
        draft.write_text(text, encoding="utf-8", newline="\n")


def report_html(data: ReportData) -> str:
    """Return the report as HTML; see ``write_report``."""
    title = escape(data.title)
    sections = (
        _checks(data),
        _shell(data),
        _charts(data),
        _sheets(data),
        _parts(data),
        _design(data),
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>\n{_asset('page.css')}</style>\n</head>\n<body>\n"
        f"{_header(data)}\n{stage(data)}<main>\n{''.join(sections)}</main>\n{_footer(data)}\n"
        f'<script type="application/octet-stream" id="report-data">{page_data(data)}</script>\n'
        f"<script>\n{_script()}</script>\n</body>\n</html>\n"
    )


def _asset(name: str) -> str:
    return resources.files("phexfab.report").joinpath(name).read_text(encoding="utf-8")


def _script() -> str:
    """Return the page's script: its files, one after the other, with names of their own."""
    files = "".join(_asset(name) for name in _SCRIPTS)
    return f'(async () => {{\n"use strict";\n{files}}})();\n'


def _header(data: ReportData) -> str:
    failed = sum(not check.ok for check in data.checks)
    total = len(data.checks)
    if not total:
        kind, word, says = "none", "NOT CHECKED", "no check was run"
    elif failed:
        kind, word, says = "fail", "FAIL", f"{failed} of {total} checks fail"
    else:
        kind, word, says = "pass", "PASS", f"all {total} checks keep their limits"
    items = "".join(
        f"<div><dt>{name}</dt><dd>{value}{f' <small>{unit}</small>' if unit else ''}</dd></div>"
        for name, value, unit in key_figures(data.shell, data.parts, len(data.sheets))
    )
    return (
        f'<header><div class="headline"><h1>{escape(data.title)}</h1>'
        f'<p class="verdict"><strong class="{kind}">{word}</strong><span>{says}</span></p></div>'
        f'<dl class="key">{items}</dl></header>'
    )


def _shell(data: ReportData) -> str:
    fields = panel_fields(data.shell)
    if not fields:
        return ""
    look = shell_view(data.shell)
    low, high = (quantity(limit, fields[0].unit, 3) for limit in fields[0].limits)
    ramp = f"background:linear-gradient(90deg,{','.join(RAMP)})"
    scale = (
        f'<span class="scale" id="ramp"><span>{low}</span><i style="{ramp}"></i>'
        f"<span>{high}</span></span>"
    )
    paint = '<label hidden>Colour by <select id="field"></select></label>'
    shell = shell_figure(data.shell, size=(960, 768), view=look, colours=256)
    gauss = gauss_figure(data.shell, size=(960, 768), view=look, colours=256)
    return (
        '<section><h2>Shell and Gauss image</h2><p class="lead">The shell M and '
        "its Gauss image S around the unit sphere. Each face of S is parallel to the face of M in "
        "the same colour, and each corner of S is the axis of a node of M. "
        f"Coloured by {fields[0].name} in this picture.</p>"
        '<div class="pair">'
        '<figure data-scene="shell" data-view="shell" data-pose="pair" data-name="The shell M">'
        f'<div class="frame">{image(shell, "The shell M")}</div>'
        f'<div class="tools">{paint}{scale}</div></figure>'
        '<figure data-scene="gauss" data-view="gauss" data-pose="pair" '
        'data-name="The Gauss image S around the unit sphere"><div class="frame">'
        f"{image(gauss, 'The Gauss image S around the unit sphere')}</div>"
        '<div class="tools"></div></figure></div></section>\n'
    )


def _checks(data: ReportData) -> str:
    if not data.checks:
        return ""
    # Failing ones first, each group in the order of the walk.
    rows = "".join(_check(check) for check in sorted(data.checks, key=lambda check: check.ok))
    return (
        "<section><h2>Checks</h2>"
        '<div class="wide"><table class="checks"><thead><tr><th>Check</th><th class="n">Value</th>'
        '<th class="n">Limit</th><th>Verdict</th><th>Worst part</th><th>What was measured</th></tr>'
        f"</thead><tbody>{rows}</tbody></table></div></section>\n"
    )


def _check(check: CheckResult) -> str:
    value = quantity(float(check.value), check.unit)
    limit = quantity(float(check.limit), check.unit)
    sign = "≤" if check.sense == "<=" else "≥"
    word = "pass" if check.ok else "fail"
    worst = escape(check.worst)
    name = label(check.name)
    button = f'<button type="button">{worst}</button>' if worst else ""
    return (
        f'<tr data-worst="{worst}" data-name="{name}"{"" if check.ok else " class=bad"}>'
        f"<td>{name}</td>"
        f'<td class="n">{value}</td>'
        f'<td class="n">{sign} {limit}</td><td class="v {word}">{word.upper()}</td>'
        f'<td>{button}</td><td class="note">{escape(check.note)}</td></tr>'
    )


def _charts(data: ReportData) -> str:
    charts = "".join(
        histogram(name, np.asarray(values), unit)
        for name, (values, unit) in data.histograms.items()
    )
    if not charts:
        return ""
    head = "<h2>Spread of sizes and angles</h2>"
    return f'<section>{head}<div class="charts">{charts}</div></section>\n'


def _sheets(data: ReportData) -> str:
    if not data.sheets:
        return ""
    cut: tuple[Panel | Beam, ...] = (*data.parts.panels, *data.parts.beams)
    flats = {part.mark: part.flat for part in cut}
    notes = "".join(f"<p>{escape(note)}</p>" for note in data.notes)
    drawings = "".join(sheet_drawing(sheet, flats, data.engraving) for sheet in data.sheets)
    return (
        '<section><h2>Sheets</h2><p class="lead">Contours to cut in black, engraving in red, '
        "as in the DXF files. Click a sheet to enlarge it.</p>"
        f'{notes}<div class="sheets">{drawings}</div></section>\n'
    )


def _parts(data: ReportData) -> str:
    figures = "".join(
        f'<tr><td>{label(name)}</td><td class="n">{escape(quantity(value, unit, 5))}</td></tr>'
        for name, (value, unit) in data.figures.items()
    )
    listed = (
        f"<div><h2>Figures</h2><table><tbody>{figures}</tbody></table></div>" if figures else ""
    )
    versions = "".join(
        f'<tr><td>{escape(name)}</td><td class="n">{escape(version)}</td></tr>'
        for name, version in data.versions.items()
    )
    made = (
        f"<div><h2>Made with</h2><table><tbody>{versions}</tbody></table></div>" if versions else ""
    )
    table = materials_table(data.parts)
    summary = f'<section><h2>Parts</h2><div class="wide">{table}</div></section>\n' if table else ""
    return f'{summary}<section class="two">{listed}{made}</section>\n'


def _design(data: ReportData) -> str:
    if not data.design_text.strip():
        return ""
    text = escape(data.design_text.rstrip())
    return f"<section><h2>Design file</h2><pre>{text}\n</pre></section>\n"


def _footer(data: ReportData) -> str:
    version = data.versions.get("phexfab", "")
    return (
        f"<footer>Lengths in {escape(data.units)} where nothing else is said. "
        f"{number(len(data.checks))} checks, made by phexfab {escape(version)}.</footer>"
    )
