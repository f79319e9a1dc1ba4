"""Rims from real DXF, STEP and BREP files, and from CadQuery and build123d objects."""

import math

import numpy as np
import pytest

from phexfab.cad.rims import read_rims, rims_of
from phexfab.errors import DesignError
from phexfab.surface.rims.rim import Rim

T = np.linspace(0.0, 1.0, 401)
SIZE = 4000.0


def drawing(unit=4):
    import ezdxf

    made = ezdxf.new("R2010")
    made.header["$INSUNITS"] = unit
    return made


def saved(made, tmp_path, name="rim.dxf"):
    made.saveas(tmp_path / name)
    return tmp_path / name


def rounded_rectangle(space, width=4000.0, depth=2000.0, radius=500.0, **where):
    w, d, r = width, depth, radius
    lines = [((r, 0), (w - r, 0)), ((w, r), (w, d - r)), ((w - r, d), (r, d)), ((0, d - r), (0, r))]
    for start, end in lines:
        space.add_line(start, end, dxfattribs=where)
    for k, centre in enumerate([(w - r, r), (w - r, d - r), (r, d - r), (r, r)]):
        space.add_arc(centre, r, -90 + 90 * k, 90 * k, dxfattribs=where)


def test_a_file_that_is_no_step_is_refused_without_the_kernel_s_noise(tmp_path, capfd):
    (tmp_path / "rim.step").write_text("hello", encoding="utf-8")
    for _ in range(2):
        with pytest.raises(DesignError, match=r"^rim\.step: is no readable STEP file; export it"):
            read_rims(tmp_path / "rim.step")
    said = capfd.readouterr()
    assert said.out + said.err == ""


def test_a_circle_of_arcs_is_a_circle(tmp_path):
    made = drawing()
    for start, end in ((170.0, 290.0), (290.0, 60.0), (60.0, 170.0)):
        made.modelspace().add_arc((100.0, 200.0, 300.0), 2000.0, start, end)
    (rim,) = read_rims(saved(made, tmp_path))
    offset = rim.point(T) - [100.0, 200.0, 300.0]
    assert np.abs(np.linalg.norm(offset, axis=1) - 2000.0).max() <= 1e-9
    assert np.abs(offset[:, 2]).max() <= 1e-12
    assert rim.length == pytest.approx(2 * math.pi * 2000.0, rel=1e-12)
    assert len(rim.corners) == 0
    # t is shared out by length: t to angle is affine, so the speed is constant.
    assert np.linalg.norm(rim.derivative(T), axis=1) == pytest.approx(rim.length, rel=1e-9)


def test_rounded_and_sharp_rectangles(tmp_path):
    made = drawing()
    rounded_rectangle(made.modelspace())
    (rim,) = read_rims(saved(made, tmp_path))
    assert len(rim.corners) == 0
    assert rim.length == pytest.approx(2 * (3000 + 1000) + 2 * math.pi * 500, rel=1e-12)
    sharp = drawing()
    sharp.modelspace().add_lwpolyline([(0, 0), (4000, 0), (4000, 2000), (0, 2000)], close=True)
    (rim,) = read_rims(saved(sharp, tmp_path))
    assert len(rim.corners) == 4
    assert rim.turning(rim.corners) == pytest.approx([90.0] * 4, abs=1e-9)
    assert all(rim.is_straight(k) for k in range(4))


def test_an_extruded_arc_lies_in_its_own_plane(tmp_path):
    made = drawing()
    space = made.modelspace()
    half = {"extrusion": (1.0, 0.0, 0.0)}  # plane YZ
    space.add_arc((500.0, 600.0, 700.0), 1000.0, 0.0, 180.0, dxfattribs=half)
    space.add_line((700.0, -500.0, 600.0), (700.0, 1500.0, 600.0))
    (rim,) = read_rims(saved(made, tmp_path))
    points = rim.point(T)
    assert np.abs(points[:, 0] - 700.0).max() <= 1e-9
    assert points[:, 2].min() == pytest.approx(600.0, abs=1e-9)
    assert points[:, 2].max() == pytest.approx(1600.0, abs=0.1)
    assert len(rim.corners) == 2


def test_bulges_are_exact_arcs(tmp_path):
    made = drawing()
    bulge = math.tan(math.radians(180.0) / 4.0)
    made.modelspace().add_lwpolyline(
        [(0, 0, bulge), (2000, 0, bulge)], format="xyb", close=True, dxfattribs={"elevation": 50}
    )
    (rim,) = read_rims(saved(made, tmp_path))
    offset = rim.point(T) - [1000.0, 0.0, 50.0]
    assert np.abs(np.linalg.norm(offset, axis=1) - 1000.0).max() <= 1e-9


def test_ellipse_splits_and_full(tmp_path):
    made = drawing()
    space = made.modelspace()
    space.add_ellipse((0, 0, 10), (2000, 0, 0), 0.5, 0.0, 2.0)
    space.add_ellipse((0, 0, 10), (2000, 0, 0), 0.5, 2.0, 2 * math.pi)
    space.add_ellipse((0, 5000, 10), (2000, 0, 0), 0.5)
    space.add_circle((0, 9000, 0), 700.0)
    parts, full, circle = read_rims(saved(made, tmp_path))
    for rim, centre in ((parts, (0, 0, 10)), (full, (0, 5000, 10))):
        x, y, z = (rim.point(T) - centre).T
        assert np.abs((x / 2000) ** 2 + (y / 1000) ** 2 - 1.0).max() <= 1e-12
        assert np.abs(z).max() == 0.0
        assert len(rim.corners) == 0
    assert circle.length == pytest.approx(2 * math.pi * 700, rel=1e-12)
    assert [rim.name for rim in (parts, full, circle)] == [f"rim.dxf:{k}" for k in (1, 2, 3)]


def test_splines_agree_with_ezdxf(tmp_path):
    made = drawing()
    space = made.modelspace()
    controls = [(0, 0, 0), (500, 1500, 900), (2500, 1800, 100), (3000, 0, 0)]
    rational = space.add_rational_spline(controls, [1.0, 2.0, 0.7, 1.0], degree=3)
    back = space.add_open_spline([(3000, 0, 0), (2000, -1500, 600), (0, 0, 0)], degree=2)
    (rim,) = read_rims(saved(made, tmp_path))
    assert len(rim.corners) == 2
    for entity in (rational, back):
        tool = entity.construction_tool()
        exact = np.array([p.xyz for p in tool.points(np.linspace(0, tool.max_t, 17))])
        dense = rim.point(np.linspace(0, 1, 20001))
        near = np.linalg.norm(exact[:, None] - dense[None], axis=2).min(axis=1)
        assert near.max() < 0.5  # within the sampling: speed 9 m over 20,000 steps
    # Quotient rule: derivatives agree with differences of the point.
    t = np.array([0.05, 0.21, 0.4, 0.77])
    step = 1e-5
    slope = (rim.point(t + step) - rim.point(t - step)) / (2 * step)
    assert rim.derivative(t) == pytest.approx(slope, rel=1e-6, abs=1e-3)
    bend = (rim.derivative(t + step) - rim.derivative(t - step)) / (2 * step)
    assert rim.derivative(t, 2) == pytest.approx(bend, rel=1e-6, abs=1e-2)


def test_rational_quadratic_is_a_circle(tmp_path):
    made = drawing()
    weight = math.sqrt(0.5)
    square = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    spline = made.modelspace().add_spline(degree=2)
    spline.control_points = [(1000 * x, 1000 * y, 0) for x, y in square]
    spline.knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    spline.weights = [1, weight, 1, weight, 1, weight, 1, weight, 1]
    (rim,) = read_rims(saved(made, tmp_path))
    assert np.abs(np.linalg.norm(rim.point(T), axis=1) - 1000.0).max() <= 1e-9
    assert len(rim.corners) == 0  # double knots, but no kink
    assert np.abs(np.cross(rim.derivative(T), rim.derivative(T, 2))[:, 2]).min() > 0.0


def test_many_short_lines_are_the_chords_of_a_curve(tmp_path):
    made = drawing()
    angles = np.linspace(0, 2 * np.pi, 49)[:-1]
    ring = np.stack(
        [1500 * np.cos(angles), 1500 * np.sin(angles), 200 * np.cos(2 * angles)], axis=1
    )
    made.modelspace().add_polyline3d(ring.tolist(), close=True)
    (rim,) = read_rims(saved(made, tmp_path))
    assert len(rim.corners) == 0
    assert np.abs(np.hypot(*rim.point(T)[:, :2].T) - 1500.0).max() < 1e-3


def test_units_layers_and_blocks(tmp_path):
    made = drawing(unit=6)
    made.layers.add("RIM")
    block = made.blocks.new("frame")
    rounded_rectangle(block, 4.0, 2.0, 0.5, layer="RIM")
    made.modelspace().add_blockref("frame", (10.0, 0.0))
    made.modelspace().add_line((0, 0), (1, 1))
    path = saved(made, tmp_path)
    (rim,) = read_rims(path, layer="rim")
    assert rim.box[0] == pytest.approx([10000.0, 0.0, 0.0], abs=1e-9)
    assert rim.box[1] == pytest.approx([14000.0, 2000.0, 0.0], abs=1e-9)
    (other,) = read_rims(path, layer=["RIM"], unit="ft")
    assert other.length == pytest.approx(rim.length * 0.3048, rel=1e-12)
    with pytest.raises(DesignError, match=r"open at \(0, 0, 0\), an end of LINE"):
        read_rims(path)
    with pytest.raises(DesignError, match="no layer 'EDGE'; there are"):
        read_rims(path, layer="EDGE")
    with pytest.raises(DesignError, match=r"no curve in model space on layer '0'|open at"):
        read_rims(path, layer="0")


def test_open_doubled_and_branching_drawings_are_refused(tmp_path):
    made = drawing()
    space = made.modelspace()
    space.add_line((0, 0), (3000, 0))
    space.add_line((3000, 0), (3000, 2000))
    last = space.add_line((3000, 2000), (0, 5))
    with pytest.raises(
        DesignError,
        match=rf"open at \(0, 0, 0\).*5 mm away at \(0, 5, 0\) \(LINE {last.dxf.handle}\)",
    ):
        read_rims(saved(made, tmp_path))
    (rim,) = read_rims(saved(made, tmp_path), tolerance=6.0)
    t = rim.corners
    assert rim.point(t)[0] == pytest.approx([0.0, 2.5, 0.0], abs=1e-9)  # drawn together
    space.add_line((3000, 0), (0, 0))
    with pytest.raises(DesignError, match=r"LINE \w+ and LINE \w+ at \(.*\) are the same curve"):
        read_rims(saved(made, tmp_path), tolerance=6.0)
    space.delete_entity(space[-1])
    space.add_line((3000, 2000), (5000, 2000))
    with pytest.raises(DesignError, match=r"3 ends meet at \(3000, 2000, 0\)"):
        read_rims(saved(made, tmp_path), tolerance=6.0)
    empty = drawing()
    empty.modelspace().add_point((0, 0))
    with pytest.raises(DesignError, match="no curve in model space; found 1 POINT"):
        read_rims(saved(empty, tmp_path))


def test_drawing_in_the_wrong_unit_is_refused(tmp_path):
    made = drawing(unit=4)
    rounded_rectangle(made.modelspace(), 12.0, 9.0, 1.0)
    path = saved(made, tmp_path)
    with pytest.raises(DesignError, match=r"size is 15 mm.*probably in m: say unit = 'm'"):
        read_rims(path)
    (rim,) = read_rims(path, unit="m")
    assert rim.box[1] == pytest.approx([12000.0, 9000.0, 0.0])
    with pytest.raises(DesignError, match="no unit 'parsec'"):
        read_rims(path, unit="parsec")


def saddle_wire():
    """Two splines and a line and an arc, in space, by CadQuery."""
    import cadquery as cq

    vector = cq.Vector
    spline = cq.Edge.makeSpline(
        [vector(0, 0, 0), vector(1500, -300, 400), vector(3000, 0, 0)],
    )
    side = cq.Edge.makeLine(vector(3000, 0, 0), vector(3000, 2000, 700))
    arc = cq.Edge.makeThreePointArc(
        vector(3000, 2000, 700), vector(1500, 2600, 900), vector(0, 2000, 300)
    )
    bezier = cq.Edge.makeBezier([vector(0, 2000, 300), vector(-400, 1000, 500), vector(0, 0, 0)])
    return cq.Wire.assembleEdges([spline, side, arc, bezier])


def kernel_distance(points, wire):
    """Distance of points from a wire by OpenCASCADE's own extrema, the independent route."""
    import cadquery as cq

    return max(cq.Vertex.makeVertex(*p).distance(wire) for p in points.tolist())


@pytest.mark.parametrize("suffix", ["step", "brep"])
def test_wires_of_files_are_exact(tmp_path, suffix):
    wire = saddle_wire()
    path = tmp_path / f"rim.{suffix}"
    if suffix == "step":
        import cadquery as cq

        cq.exporters.export(cq.Workplane(obj=wire), str(path))
    else:
        wire.exportBrep(str(path))
    (rim,) = read_rims(path)
    assert len(rim.corners) == 4
    assert rim.length == pytest.approx(wire.Length(), rel=1e-9)
    assert kernel_distance(rim.point(T[::10]), wire) <= 1e-9 * SIZE
    assert sum(rim.is_straight(k) for k in range(4)) == 1


def test_cadquery_objects():
    import cadquery as cq

    wire = saddle_wire()
    (from_wire,) = rims_of(wire)
    (from_edges,) = rims_of(list(wire.Edges())[::-1])
    (from_plane,) = rims_of(cq.Workplane(obj=wire), name="canopy")
    assert from_plane.name == "canopy"
    for rim in (from_wire, from_edges, from_plane):
        assert rim.length == pytest.approx(wire.Length(), rel=1e-9)
        assert len(rim.corners) == 4
    (slot,) = rims_of(cq.Workplane().slot2D(4000.0, 1000.0))
    assert len(slot.corners) == 0
    assert slot.length == pytest.approx(6000.0 + 1000.0 * math.pi, rel=1e-9)
    court = cq.Workplane().rect(4000.0, 3000.0).extrude(100.0).faces(">Z").hole(1000.0)
    outer, inner = sorted(rims_of(court.faces(">Z")), key=lambda rim: -rim.length)
    assert outer.length == pytest.approx(14000.0, rel=1e-12)
    assert np.abs(np.hypot(*inner.point(T)[:, :2].T) - 500.0).max() <= 1e-9
    with pytest.raises(DesignError, match="is closed: its faces have no border"):
        rims_of(court)
    with pytest.raises(DesignError, match="int holds no edges"):
        rims_of(3)


def test_border_of_an_open_cylinder_leaves_out_its_seam():
    import cadquery as cq

    tube = cq.Workplane().circle(1000.0).extrude(500.0).faces("not |Z")
    one, two = rims_of(tube)
    assert sorted(rim.point(0.0)[2] for rim in (one, two)) == pytest.approx([0.0, 500.0], abs=1e-9)


def test_build123d_objects():
    import build123d as b3d

    wire = b3d.Wire(
        [
            b3d.Edge.make_circle(1500.0, start_angle=0, end_angle=270),
            b3d.Edge.make_line((0, -1500, 0), (1500, 0, 0)),
        ]
    )
    (rim,) = rims_of(wire)
    assert rim.length == pytest.approx(1500 * (1.5 * math.pi + math.sqrt(2)), rel=1e-12)
    assert len(rim.corners) == 2
    with b3d.BuildLine() as line:
        b3d.Polyline((0, 0, 0), (3000, 0, 500), (3000, 2000, 0), (0, 2000, 500), close=True)
    for thing in (line, line.line):
        (rim,) = rims_of(thing)
        assert len(rim.corners) == 4
    (rim,) = rims_of(b3d.Ellipse(2000, 1000).face())
    x, y, _ = rim.point(T).T
    assert np.abs((x / 2000) ** 2 + (y / 1000) ** 2 - 1.0).max() <= 1e-12


def test_offset_curves_are_evaluated_by_the_kernel():
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.Geom import Geom_Ellipse, Geom_OffsetCurve
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    ellipse = Geom_Ellipse(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), 2000.0, 1000.0)
    edge = BRepBuilderAPI_MakeEdge(Geom_OffsetCurve(ellipse, 100.0, gp_Dir(0, 0, 1))).Edge()
    (rim,) = rims_of(edge)
    # A parallel curve at distance d is longer by 2πd.
    (inner,) = rims_of(BRepBuilderAPI_MakeEdge(ellipse).Edge())
    assert rim.length - inner.length == pytest.approx(2 * math.pi * 100.0, rel=1e-9)


def test_step_states_its_unit(tmp_path):
    import cadquery as cq

    path = tmp_path / "rim.step"
    cq.exporters.export(cq.Workplane().rect(12.0, 9.0), str(path))
    with pytest.raises(DesignError, match="probably in m: say unit = 'm'"):
        read_rims(path)
    (rim,) = read_rims(path, unit="m")
    assert rim.length == pytest.approx(42000.0, rel=1e-12)
    text = path.read_text().replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)")
    path.write_text(text)
    (rim,) = read_rims(path)
    assert rim.length == pytest.approx(42000.0, rel=1e-12)
    (same,) = read_rims(path, unit="m")
    assert same.length == pytest.approx(42000.0, rel=1e-12)


def test_points_and_rims_go_through():
    corners = np.array([[0.0, 0, 0], [12000, 0, 3000], [12000, 9000, 0], [0, 9000, 4000]])
    (rim,) = rims_of(corners)
    assert len(rim.corners) == 4
    (metres,) = rims_of(corners / 1000.0, unit="m")
    assert metres.length == pytest.approx(rim.length, rel=1e-12)
    (smooth,) = rims_of(rim, smooth=500.0)
    assert len(smooth.corners) == 0
    with pytest.raises(DesignError, match="at most"):
        rims_of(rim, smooth=6000.0)


def test_front_door(tmp_path):
    table = tmp_path / "rim.csv"
    table.write_text("0,0,0\n12000,0,3000\n12000,9000,0\n0,9000,4000\n")
    (rim,) = read_rims(table)
    assert isinstance(rim, Rim)
    assert len(rim.corners) == 4
    with pytest.raises(DesignError, match="only DXF drawings have layers"):
        read_rims(table, layer="RIM")
    with pytest.raises(DesignError, match=r"rims are read from \.csv"):
        read_rims(tmp_path / "rim.pdf")
    for name in ("absent.step", "absent.brep", "absent.dxf", "absent.csv"):
        with pytest.raises(DesignError, match=name):
            read_rims(tmp_path / name)
    for name in ("bad.step", "bad.brep", "bad.dxf"):
        (tmp_path / name).write_text("no such thing")
        with pytest.raises(DesignError, match=name):
            read_rims(tmp_path / name)
