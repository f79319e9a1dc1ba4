"""Parts of cut shells: panels, beams and hubs come out as valid solids."""

import numpy as np
import pytest
from cut_samples import border, circle, polygon, whole

from phexfab.fabrication.bars import BeamSpec
from phexfab.fabrication.beams import beams
from phexfab.fabrication.nodes import NodeSpec, nodes
from phexfab.fabrication.panels import PanelSpec, panels
from phexfab.parallel.cut import cut_shell
from phexfab.parallel.offset import admissible_interval
from phexfab.testing import assert_closed_solid

CUTS = {
    "ring": ([(circle(0.5), ()), (circle(0.2, turn=-1), ())], {}),
    "square": (
        [polygon(0.45 * np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j]) * np.exp(0.2j))],
        {},
    ),
    "plumb": ([(circle(0.25), ())], {"direction": (0, 0, 1)}),
}


@pytest.mark.parametrize("kind", ["face", "edge", "vertex"])
@pytest.mark.parametrize("name", list(CUTS))
def test_parts_of_cut_shells_are_closed_solids(name, kind):
    smooth, shell = whole(size=500.0, kind=kind)
    drawn, options = CUTS[name]
    borders = [border(smooth, w, corners) for w, corners in drawn]
    made = cut_shell(shell, borders, depth=90.0, shortest_edge=35.0, **options).shell
    if name != "plumb":  # axes that are parallel leave edges of S without length
        low, high = admissible_interval(made)
        assert low < -60 and high > 60
    for edges in ("square", "mitred"):
        spec = PanelSpec(6.0, 4.0, "outside", edges)
        plates = panels(made, spec)
        assert len(plates) == made.mesh.n_faces
        for plate in plates:
            assert_closed_solid(plate.solid)
    for ends in ("mitred", "hub"):
        bar = BeamSpec(6.0, 30.0, ends, hub_radius=8.0)
        bars = beams(made, bar, spec)
        assert len(bars) == len(made.edges)
        for part in bars:
            assert_closed_solid(part.solid)
    for part in nodes(made, NodeSpec("hub", 8.0), bar, spec):
        assert part.volume > 0


def test_beams_on_the_border_stand_in_the_rim_planes():
    smooth, shell = whole(size=400.0)
    made = cut_shell(shell, [border(smooth, circle(0.5))], shortest_edge=35.0).shell
    bars = beams(made, BeamSpec(6.0, 30.0), PanelSpec(6.0, 4.0))
    rim = np.flatnonzero(made.rim_edges)
    assert len(rim) > 30
    beyond = {}
    for panel, ring in zip(made.panels, np.split(made.rings[3], made.rings[1][1:-1]), strict=True):
        for other in ring.tolist():
            beyond.setdefault(int(panel), []).append(other)
    for e in rim.tolist():
        left = int(made.panels[made.edges[e, 2]])
        points = bars[e].solid.vertices
        # Half of the bar's corners lie on each side of one of the panel's rim planes, 3 mm off.
        best = min(
            float(np.abs(np.abs(points @ made.normals[f] - made.heights[f])).max())
            for f in beyond[left]
            if made.parents[f] < 0
        )
        assert best == pytest.approx(3.0, abs=1e-6)
