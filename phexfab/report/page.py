"""The report: one HTML file with pictures, views, checks, charts and sheets, for any browser.

Nothing in it is loaded from elsewhere: style, script, geometry and pictures stand in the file, and
a content policy in its head forbids the rest.
"""

from __future__ import annotations

import base64
from html import escape
from importlib import resources
from os import PathLike

import numpy as np

from phexfab.fabrication.parts import Beam, CheckResult, Panel
from phexfab.report.charts import histogram
from phexfab.report.data import ReportData
from phexfab.report.drawings import sheet_drawing
from phexfab.report.fields import RAMP, panel_fields, shell_view
from phexfab.report.figures import assembly_figure, gauss_figure, shell_figure
from phexfab.report.pack import dump, page_scenes
from phexfab.report.summary import key_figures, materials_table
from phexfab.report.text import label, number, quantity
from phexfab.whole import whole

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
        _assembly(data),
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
        f"{_header(data)}\n<main>\n{''.join(sections)}</main>\n{_footer(data)}\n"
        f'<script type="application/json" id="report-data">{dump(page_scenes(data))}</script>\n'
        f"<script>\n{_asset('view.js')}</script>\n</body>\n</html>\n"
    )


def _asset(name: str) -> str:
    return resources.files("phexfab.report").joinpath(name).read_text(encoding="utf-8")


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
        f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in key_figures(data)
    )
    return (
        f'<header><div class="headline"><div><p class="kind">Build report</p>'
        f"<h1>{escape(data.title)}</h1></div>"
        f'<p class="verdict"><strong class="{kind}">{word}</strong><span>{says}</span></p></div>'
        f'<dl class="key">{items}</dl></header>'
    )


def _assembly(data: ReportData) -> str:
    parts = data.parts
    if not (parts.panels or parts.beams or parts.nodes):
        return ""
    picture = assembly_figure(parts, size=(1440, 864), view=shell_view(data.shell), colours=256)
    hint = "Drag to turn, shift-drag to move, click then wheel to zoom, double-click to go back."
    find = (
        '<span class="find"><input type="search" id="find" size="14" placeholder="Find a mark" '
        'aria-label="Find a part by its mark"></span>'
    )
    return (
        f'<figure class="hero" data-scene="assembly"><div class="frame">'
        f"{_image(picture, 'The assembly: panels, beams and nodes')}</div>"
        f'<div class="tools"><span class="hint">{hint}</span>{find}</div></figure>\n'
    )


def _shell(data: ReportData) -> str:
    fields = panel_fields(data.shell)
    if not fields:
        return ""
    look = shell_view(data.shell)
    low, high = (quantity(limit, fields[0].unit, 3) for limit in fields[0].limits)
    ramp = f"background:linear-gradient(90deg,{','.join(RAMP)})"
    scale = (
        f'<span class="scale"><span>{low}</span><i style="{ramp}"></i><span>{high}</span></span>'
    )
    shell = shell_figure(data.shell, size=(960, 768), view=look, colours=256)
    gauss = gauss_figure(data.shell, size=(960, 768), view=look, colours=256)
    return (
        '<section><h2>Shell and Gauss image</h2><p class="lead">The shell M and '
        "its Gauss image S around the unit sphere. Each face of S is parallel to the face of M in "
        "the same colour, and each corner of S is the axis of a node of M. "
        f"Coloured by {fields[0].name} in this picture.</p>"
        '<div class="pair">'
        f'<figure data-scene="shell"><div class="frame">{_image(shell, "The shell M")}</div>'
        f'<div class="tools">{scale}</div></figure>'
        f'<figure data-scene="gauss"><div class="frame">'
        f"{_image(gauss, 'The Gauss image S around the unit sphere')}</div>"
        '<div class="tools"></div></figure></div></section>\n'
    )


def _image(png: bytes, text: str) -> str:
    code = base64.b64encode(png).decode("ascii")
    return f'<img alt="{escape(text)}" src="data:image/png;base64,{code}">'


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
    button = f'<button type="button" data-mark="{worst}">{worst}</button>' if worst else ""
    return (
        f"<tr{'' if check.ok else ' class=bad'}><td>{label(check.name)}</td>"
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
