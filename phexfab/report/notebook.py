"""What a notebook shows of a build: its picture, its verdict, the checks that fail."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING

from phexfab.report.figures import assembly_figure

if TYPE_CHECKING:
    from phexfab.pipeline import Build

SIZE = (900, 560)
COLOURS = 64
"""A palette keeps a picture below a hundred kilobytes: notebooks keep all they have shown."""


def build_html(built: Build) -> str:
    """Return a build as HTML that needs nothing else: a picture, what it is, what fails.

    Parameters
    ----------
    built : Build
    """
    picture = assembly_figure(built.parts, size=SIZE, colours=COLOURS)
    encoded = base64.b64encode(picture).decode("ascii")
    rows = "".join(
        f"<li>{escape(check.name)}: {check.value:.3g} {escape(check.unit)}, limit "
        f"{check.limit:g}, worst {escape(check.worst)}. {escape(check.note)}</li>"
        for check in built.checks
        if not check.ok
    )
    said = escape(repr(built).strip("<>").removeprefix("Build "))
    return (
        f'<figure style="margin:0"><img alt="{said}" style="max-width:100%" '
        f'width="{SIZE[0]}" src="data:image/png;base64,{encoded}">'
        f"<figcaption>{said}</figcaption></figure>" + (f"<ul>{rows}</ul>" if rows else "")
    )
