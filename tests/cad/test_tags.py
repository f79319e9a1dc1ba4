"""Names of faces and frames on parts, against the shell they come from."""

import numpy as np
import pytest
from cad_builds import small_build
from cad_samples import sample_parts

from phexfab.cad.tags import beams_below, face_tags, frames
from phexfab.cad.tree import metadata
from phexfab.errors import PartError
from phexfab.fabrication.frames import edge_frames
from phexfab.fabrication.parts import Parts


@pytest.fixture(scope="module", params=["mitred", "hubs"])
def build(request):
    return small_build(request.param)


def tagged(build, part):
    """Outward normal and centre of each face, by tag."""
    found = {}
    below = beams_below(build.parts)
    for face, tags in zip(part.solid.faces, face_tags(part, below), strict=True):
        corners = part.solid.vertices[list(face)]
        area = np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(0)
        for tag in tags:
            found.setdefault(tag, []).append((area / np.linalg.norm(area), corners.mean(axis=0)))
    return found


def test_panels_stand_with_their_bottoms_on_the_tops_of_beams(build):
    panels = {panel.mark: panel for panel in build.parts.panels}
    assert beams_below(build.parts) == (build.design.panels.side != "inside")
    for beam in build.parts.beams:
        ((up, crest),) = tagged(build, beam)["top"]
        ((down, foot),) = tagged(build, beam)["bottom"]
        assert up @ (crest - foot) > 0 > down @ (crest - foot)
        for mark in set(beam.neighbours) & set(panels):
            own = tagged(build, panels[mark])
            ((out, face),), ((_, back),) = own["top"], own["bottom"]
            assert out @ (face - back) == pytest.approx(build.design.panels.thickness)
            assert out @ (crest - back) < 0  # the bar is below the panel's bottom
            assert out @ up > 0.5


def test_sides_run_along_the_edges_of_the_shell_and_face_the_neighbours(build):
    shell, half = build.shell, build.design.panels.gap / 2
    mesh = shell.mesh
    by_mark = {panel.mark: tagged(build, panel) for panel in build.parts.panels}
    bevelled = build.design.panels.edges == "mitred"
    for panel in build.parts.panels:
        own = by_mark[panel.mark]
        ring = mesh.corners[mesh.starts[panel.face] : mesh.starts[panel.face + 1]]
        for k, (i, j) in enumerate(zip(ring, np.roll(ring, -1), strict=True), 1):
            ((normal, centre),) = own[f"side_{k}"]
            for corner in mesh.vertices[[i, j]]:
                assert normal @ (corner - centre) == pytest.approx(half, abs=1e-9)
            assert (f"mitre_{k}" in own) == bevelled
        for note in panel.flat.edges:
            if note.neighbour:
                (a, p), (b, q) = (
                    own[f"to_{note.neighbour}"][0],
                    by_mark[note.neighbour][f"to_{panel.mark}"][0],
                )
                assert a @ b < -0.8
                if bevelled:
                    assert a @ b == pytest.approx(-1) and a @ (q - p) == pytest.approx(2 * half)


def test_sides_and_ends_of_beams(build):
    vertices, edges = build.shell.mesh.vertices, build.shell.edges
    for beam in build.parts.beams:
        own = tagged(build, beam)
        i, j = edges[beam.edge, :2]
        frame = edge_frames(build.shell, np.array([i]), np.array([j]))
        along, left = frame.along[0], frame.left[0]
        assert own["left"][0][0] @ left == pytest.approx(1)
        assert own["right"][0][0] @ left == pytest.approx(-1)
        for end, (vertex, mark, out) in enumerate(
            zip((i, j), beam.nodes, (-along, along), strict=True), 1
        ):
            faces = own[f"end_{end}"]
            assert [c.tolist() for _, c in faces] == [c.tolist() for _, c in own[f"to_{mark}"]]
            other = vertices[j if end == 1 else i]
            axis = build.shell.gauss.vertices[vertex]
            axis = axis / np.linalg.norm(axis)
            for _, centre in faces:
                here, there = (np.linalg.norm(centre - v) for v in (vertices[vertex], other))
                assert here < there
            for side, sign, angle in zip((1, 2), (1, -1), beam.mitres[end - 1], strict=True):
                ((normal, centre),) = own[f"mitre_{2 * end - 2 + side}"]
                # against the cut square to the middle plane, along the node axis
                assert normal @ axis == pytest.approx(0, abs=1e-9)
                square = out - (out @ axis) * axis
                square /= np.linalg.norm(square)
                cut = np.degrees(np.arctan2(sign * (normal @ left), normal @ square))
                assert cut == pytest.approx(angle, abs=1e-7)
                if len(faces) == 2:  # of a pointed end, the half on that side
                    assert sign * ((centre - vertices[i]) @ left) > 0


def test_what_faces_are_called_may_stand_in_a_query(build):
    for part in (*build.parts.panels, *build.parts.beams):
        names = {tag for tags in face_tags(part) for tag in tags}
        assert all(name.replace("_", "").isalnum() and name[0].isalpha() for name in names)


def test_frames_stand_on_the_parts(build):
    for family in ("panels", "beams"):
        parts = getattr(build.parts, family)
        found = frames(build, family)
        assert [frame.mark for frame in found] == [part.mark for part in parts]
        for part, frame in zip(parts, found, strict=True):
            ((normal, centre),) = tagged(build, part)["top"]
            assert frame.z @ normal == pytest.approx(1)
            assert (frame.origin - centre) @ normal == pytest.approx(0, abs=1e-9)
            assert frame.x @ frame.z == pytest.approx(0, abs=1e-12)
            if family == "beams":
                i, j = build.shell.edges[part.edge, :2]
                tips = build.shell.mesh.vertices[[i, j]]
                away = np.linalg.norm(tips - frame.origin, axis=1)
                assert away[0] == pytest.approx(away[1])
                assert frame.x @ (tips[1] - tips[0]) == pytest.approx(
                    np.linalg.norm(np.diff(tips, axis=0))
                )


def test_frames_at_nodes_lie_in_the_planes_of_all_bars(build):
    """No torsion: the middle planes of all bars at a node hold its axis."""
    found = {frame.mark: frame for frame in frames(build)}
    assert len(found) == len(build.shell.mesh.vertices)
    first = {}
    for beam in build.parts.beams:
        ((left, side),), ((_, other),) = (tagged(build, beam)[name] for name in ("left", "right"))
        top = tagged(build, beam)["top"][0][0]
        for mark in beam.nodes:
            frame = found[mark]
            assert frame.z @ left == pytest.approx(0, abs=1e-9)
            assert frame.z @ top > 0
            assert (frame.origin - (side + other) / 2) @ left == pytest.approx(0, abs=1e-7)
            if mark not in first:
                first[mark] = beam
                toward = (side + other) / 2 - frame.origin
                assert frame.x @ toward > 0 and frame.x @ left == pytest.approx(0, abs=1e-9)
    for node in build.parts.nodes:
        frame = found[node.mark]
        assert np.cross(frame.z, node.cylinder.axis) == pytest.approx(0, abs=1e-12)
        assert frame.z @ node.cylinder.axis > 0
        assert np.cross(node.cylinder.base - frame.origin, frame.z) == pytest.approx(0, abs=1e-7)


def test_frames_by_mark_and_refusals(build):
    assert [f.mark for f in frames(build, ["B002", "P001", "N004"])] == ["B002", "P001", "N004"]
    assert [f.mark for f in frames(build, "P002")] == ["P002"]
    for name in ("P999", "windows", ""):
        with pytest.raises(PartError, match="to place things on"):
            frames(build, name)
    with pytest.raises(PartError, match="int has no shell"):
        frames(3)


def test_metadata_is_the_parts_list(build):
    for family, letter in (("panels", "P"), ("beams", "B"), ("nodes", "N")):
        for part in getattr(build.parts, family):
            found = metadata(part)
            assert found["family"] == family and found["mark"][0] == letter
            assert found["mass"] == pytest.approx(found["volume"] * found["density"] * 1e-9)
            assert part.mark not in found["neighbours"] and "" not in found["neighbours"]
            assert found["material"] == getattr(build.design, family).material


def test_parts_without_beams_have_their_tops_on_the_side_of_the_normals():
    assert beams_below(Parts(sample_parts(2, 0, 0).panels))
