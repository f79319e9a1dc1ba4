"""What was made, in a few numbers: the header's figures and the parts by material."""

from __future__ import annotations

from html import escape

import numpy as np

from phexfab.fabrication.parts import Beam, Node, Panel, Parts
from phexfab.parallel.shell import Shell
from phexfab.report.text import number, quantity


def key_figures(shell: Shell, parts: Parts, n_sheets: int) -> list[tuple[str, str, str]]:
    """Return what a shell is in a few numbers, as (name, value, unit)."""
    made: tuple[Panel | Beam | Node, ...] = (*parts.panels, *parts.beams, *parts.nodes)
    mass = sum(part.mass for part in made)
    points = shell.mesh.vertices
    figures = [("Panels", number(len(parts.panels)), ""), ("Beams", number(len(parts.beams)), "")]
    hubs = len(parts.nodes)
    figures.append(("Nodes", number(hubs or len(points)), "" if hubs else "no hubs"))
    if len(points):
        size = " × ".join(f"{s / 1000:.2f}" for s in np.ptp(points, axis=0))
        figures.append(("Size", size, "m"))
    area = sum(panel.area for panel in parts.panels) / 1e6
    figures.append(("Panel area", number(area, 3), "m²"))
    heavy = mass >= 10_000
    shown = number(mass / 1000 if heavy else round(mass, 1), 3 if heavy else 4)
    figures.append(("Mass", shown, "t" if heavy else "kg"))
    figures.append(("Sheets", number(n_sheets), ""))
    return figures


def materials_table(parts: Parts) -> str:
    """Return parts counted by family, material and thickness or section, as an HTML table."""
    groups: dict[tuple[str, str, str], list[tuple[float, float, float]]] = {}
    for panel in parts.panels:
        key = ("Panels", panel.flat.material.name, quantity(panel.flat.thickness, "mm"))
        groups.setdefault(key, []).append((panel.area, panel.volume, panel.mass))
    for beam in parts.beams:
        flat = beam.flat
        key = ("Beams", flat.material.name, quantity(flat.thickness, "mm"))
        groups.setdefault(key, []).append((_area(flat.outline), beam.volume, beam.mass))
    for node in parts.nodes:
        key = ("Nodes", node.material.name, f"⌀ {quantity(2 * node.cylinder.radius, 'mm')}")
        groups.setdefault(key, []).append((0.0, node.volume, node.mass))
    if not groups:
        return ""
    rows = ""
    for (family, material, size), members in groups.items():
        area, volume, mass = np.array(members).sum(0)
        flat_area = quantity(area / 1e6, "m²") if area else ""
        rows += (
            f'<tr><td>{family}</td><td>{escape(material)}</td><td class="n">{size}</td>'
            f'<td class="n">{number(len(members))}</td><td class="n">{flat_area}</td>'
            f'<td class="n">{quantity(volume / 1e9, "m³")}</td>'
            f'<td class="n">{quantity(mass, "kg")}</td></tr>'
        )
    sums = [np.array(members).sum(0) for members in groups.values()]
    count = sum(len(members) for members in groups.values())
    total = np.sum(sums, axis=0)
    return (
        '<table><thead><tr><th>Family</th><th>Material</th><th class="n">Thickness</th>'
        '<th class="n">Parts</th><th class="n">Cut area</th><th class="n">Volume</th>'
        f'<th class="n">Mass</th></tr></thead><tbody>{rows}</tbody>'
        "<tfoot><tr><td>Total</td><td></td><td></td>"
        f'<td class="n">{number(count)}</td><td></td>'
        f'<td class="n">{quantity(total[1] / 1e9, "m³")}</td>'
        f'<td class="n">{quantity(total[2], "kg")}</td></tr></tfoot></table>'
    )


def _area(outline: np.ndarray) -> float:
    x, y = outline[:, 0] - outline[0, 0], outline[:, 1] - outline[0, 1]
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
