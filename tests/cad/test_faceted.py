"""What is refused before any kernel sees it, and the tree that all exports share."""

from dataclasses import replace

import numpy as np
import pytest
from cad_samples import geometries, panel, panel_solid, prism_faces, sample_parts

from phexfab.cad.faceted import batches, topology
from phexfab.cad.tree import families
from phexfab.errors import PartError
from phexfab.fabrication.parts import Parts, Solid

CUBE = Solid(
    np.array([[x, y, z] for z in (0.0, 10) for x, y in ((0, 0), (20, 0), (20, 30), (0, 30))]),
    prism_faces(4),
)


def only(solid):
    return batches([solid], ["P007"])


def test_topology_of_a_prism_obeys_euler():
    for n in (3, 5, 6, 9):
        shape = topology(prism_faces(n))
        assert len(shape.used) - len(shape.edges) + len(shape.faces) == 2
        ends = {tuple(sorted(edge)) for edge in shape.edges.tolist()}
        assert len(ends) == len(shape.edges) == 3 * n


def test_measures_of_a_box():
    (batch,) = only(CUBE)
    lower, upper, *sides = batch.normals[0]
    assert lower.tolist() == [0, 0, -1] and upper.tolist() == [0, 0, 1]
    assert [side.tolist() for side in sides] == [[0, -1, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0]]
    assert sorted(batch.lengths[0].tolist()) == [10.0] * 4 + [20.0] * 4 + [30.0] * 4
    assert batch.warp[0] == 0


def test_batches_keep_every_solid_and_its_place():
    parts = sample_parts()
    solids = [p.solid for p in parts.panels]
    grouped = batches(solids, [p.mark for p in parts.panels])
    assert len(grouped) == 2
    assert sorted(np.concatenate([b.index for b in grouped]).tolist()) == list(range(len(solids)))
    for batch in grouped:
        for place, points in zip(batch.index, batch.points, strict=True):
            assert np.array_equal(points, solids[place].vertices)


@pytest.mark.parametrize(
    ("solid", "reason"),
    [
        (Solid(CUBE.vertices, CUBE.faces[:-1]), "has one face only"),
        (Solid(CUBE.vertices, (CUBE.faces[0][::-1], *CUBE.faces[1:])), "in one direction"),
        (Solid(CUBE.vertices, (*CUBE.faces, (0, 1))), "three or more different"),
        (Solid(CUBE.vertices, tuple(f[::-1] for f in CUBE.faces)), "inside out"),
        (Solid(CUBE.vertices * [1, 1, np.nan], CUBE.faces), "not a finite number"),
        (Solid(CUBE.vertices * [0, 1, 1], CUBE.faces), "0 mm is the length of its shortest edge"),
        (Solid(CUBE.vertices + np.eye(8)[:, :3] * 1e-4, CUBE.faces), "lies off its face"),
    ],
)
def test_impossible_solids_are_refused_by_mark(solid, reason):
    with pytest.raises(PartError, match=f"^P007: .*{reason}"):
        only(solid)


def test_warp_limit_is_the_model_tolerance():
    lifted = CUBE.vertices.copy()
    lifted[6, 2] += 0.9e-7
    (batch,) = only(Solid(lifted, CUBE.faces))
    assert 0 < batch.warp[0] < 1e-7
    lifted[6, 2] += 3e-7
    with pytest.raises(PartError, match="planarise"):
        only(Solid(lifted, CUBE.faces))


def test_the_message_names_the_one_bad_solid_among_good_ones():
    rng = np.random.default_rng(0)
    solids = [panel_solid(rng) for _ in range(5)]
    bent = solids[3].vertices.copy()
    bent[2] += 0.01
    solids[3] = Solid(bent, solids[3].faces)
    with pytest.raises(PartError, match=r"^c3: "):
        batches(solids, [f"c{k}" for k in range(5)])


def test_families_keep_order_and_marks():
    parts = sample_parts()
    tree = families(parts)
    assert [family.name for family in tree] == ["panels", "beams", "nodes"]
    assert [m for family in tree for m, _ in family.members] == list(geometries(parts))
    assert len({family.colour for family in tree}) == 3


def test_marks_must_be_unique_and_plain():
    solid = sample_parts().panels[0].solid
    for marks in (("P1", "P1"), ("",), ("panels",), ("a/b",), ("a@b",), ("a?",)):
        with pytest.raises(PartError, match="mark"):
            families(Parts(tuple(panel(m, solid) for m in marks)))
    with pytest.raises(PartError, match="no part"):
        families(replace(sample_parts(), panels=(), beams=(), nodes=()))
