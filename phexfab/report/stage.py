"""The stage at the head of the page: the view of the assembly, its controls, and the card."""

from __future__ import annotations

import base64
from html import escape

from phexfab.report.data import ReportData
from phexfab.report.fields import RAMP, shell_view
from phexfab.report.figures import assembly_figure

_KEYS = (
    ("← → ↑ ↓", "turn", "drag; one finger"),
    ("Shift and arrows", "move", "Shift-drag or right drag; two fingers"),
    ("+ −", "nearer, farther", "wheel, once the view is clicked; pinch"),
    ("f", "fit: what is chosen, or everything", ""),
    ("0", "back to the first view", "double-click"),
    ("e", "explode and put together", "the slider"),
    ("1 … 6", "layers on and off", "the boxes"),
    ("/", "find a part by its mark", ""),
    ("Esc", "let go", "click on nothing"),
    ("?", "this list", ""),
)


def stage(data: ReportData) -> str:
    """Return the section with the assembly; nothing where there are no parts.

    Without scripts it is a picture; the controls show once the view runs.
    """
    parts = data.parts
    if not (parts.panels or parts.beams or parts.nodes):
        return ""
    name = "The assembly: panels, beams and nodes"
    picture = assembly_figure(parts, size=(1440, 864), view=shell_view(data.shell), colours=256)
    ramp = f"background:linear-gradient(90deg,{','.join(RAMP)})"
    keys = "".join(
        f"<tr><th scope=row>{_keys(key)}</th><td>{does}</td><td>{pointer}</td></tr>"
        for key, does, pointer in _KEYS
    )
    return (
        '<section class="stage" id="stage" aria-label="The assembly in 3-D">'
        '<figure class="hero" data-scene="assembly" data-view="assembly" data-pose="stage" '
        f'data-name="{name}"><div class="frame">{image(picture, name)}</div></figure>'
        '<figure class="inset" data-scene="gauss" data-view="gaussInset" data-pose="stage" '
        'data-name="The Gauss image, turning with the assembly"><div class="frame"></div>'
        "<figcaption>Gauss image</figcaption></figure>"
        '<div class="bar">'
        '<div class="find"><input type="search" id="find" role="combobox" autocomplete="off" '
        'spellcheck="false" placeholder="Find a part: P017" aria-label="Find a part by its mark" '
        'aria-expanded="false" aria-controls="found" aria-autocomplete="list">'
        '<ul id="found" role="listbox" aria-label="Parts found" hidden></ul></div>'
        '<label class="explode">Explode <input type="range" id="explode" min="0" max="100" '
        'value="0"></label>'
        '<fieldset id="layers"><legend>Layers</legend></fieldset>'
        '<label>Colour <select id="colour"><option>by family</option></select></label>'
        f'</div><p class="scale" id="scale" hidden><span></span><i style="{ramp}"></i>'
        "<span></span></p>"
        '<div class="buttons"><button type="button" id="fit" title="Back to the first view">Fit'
        '</button><button type="button" id="full" title="Full screen" aria-label="Full screen">'
        '<svg viewBox="0 0 14 14" width="14" aria-hidden="true">'
        '<path d="M1 5V1h4M9 1h4v4M13 9v4H9M5 13H1V9"/></svg></button>'
        '<button type="button" id="keys" title="Keys and gestures" aria-haspopup="dialog" '
        'aria-label="Keys and gestures">?</button></div>'
        '<aside id="card" aria-label="What is chosen"></aside>'
        '<p id="said" role="status"></p><p class="old" hidden></p>'
        '<dialog id="help" aria-labelledby="help-title"><form method="dialog">'
        '<h2 id="help-title">Keys and gestures</h2><button class="close" aria-label="Close">×'
        "</button></form><table><thead><tr><th>Key</th><th>Does</th><th>Mouse and touch</th></tr>"
        f"</thead><tbody>{keys}</tbody></table></dialog></section>\n"
    )


def image(png: bytes, text: str) -> str:
    """Return a picture that stands in the page."""
    code = base64.b64encode(png).decode("ascii")
    return f'<img alt="{escape(text)}" src="data:image/png;base64,{code}">'


def _keys(text: str) -> str:
    return " ".join(word if word in ("and", "…") else f"<kbd>{word}</kbd>" for word in text.split())
