"""Triangles of non-convex faces, and the z-buffer against rays followed one by one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phexfab.fabrication.parts import Solid
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.border import Border
from phexfab.parallel.cut import cut_shell
from phexfab.report.camera import View, fit_camera
from phexfab.report.fields import gauss_mesh
from phexfab.report.raster import rasterise
from phexfab.report.scene import mesh_layer, solid_layer
from phexfab.report.shade import picture
from phexfab.report.triangulate import triangulate
from phexfab.surface.catalog import surface

BOWTIE = [(0, 0), (2, -1), (2, 3), (0, 1.2), (-2, 3), (-2, -1)]  # a panel of a minimal surface
COMB = [
    (0, 0),
    (7, 0),
    (7, 3),
    (6, 3),
    (6, 1),
    (5, 1),
    (5, 3),
    (4, 3),
    (4, 1),
    (3, 1),
    (3, 3),
    (0, 3),
]
SPIRAL = [(0, 0), (6, 0), (6, 6), (1, 6), (1, 2), (4, 2), (4, 4), (3, 4), (3, 3), (2, 3), (2, 5),
          (5, 5), (5, 1), (0, 1)]  # fmt: skip
STRAIGHT = [(0, 0), (1, 0), (2, 0), (3, 0), (3, 2), (1.5, 2), (0, 2)]  # corners of 180 degrees


def in_space(outline, turn=0.7, tilt=0.9):
    """A plane polygon somewhere in space, far from the origin."""
    x = np.array([np.cos(turn), np.sin(turn), 0.0])
    y = np.cross([np.sin(tilt) * np.sin(turn), -np.sin(tilt) * np.cos(turn), np.cos(tilt)], x)
    return np.array([4000.0, -900.0, 250.0]) + np.asarray(outline, float) @ np.array([x, y])


def shoelace(outline):
    x, y = np.asarray(outline, float).T
    return 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))


def area_vectors(points, triangles):
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return 0.5 * np.cross(b - a, c - a)


def assert_tiles(outlines):
    """Each polygon is tiled: its triangles all turn its way and have its area together."""
    corners = [in_space(outline, 0.3 * k, 0.2 * k) for k, outline in enumerate(outlines)]
    ends = np.cumsum([len(c) for c in corners])
    points = np.concatenate(corners)
    faces = [range(end - len(c), end) for c, end in zip(corners, ends, strict=True)]
    triangles, owner = triangulate(PolyMesh.from_faces(points, faces))
    assert owner.tolist() == sorted(owner.tolist())
    for f, outline in enumerate(outlines):
        own = triangles[owner == f]
        assert len(own) == len(outline) - 2
        assert set(own.ravel()) == set(faces[f])
        pieces = area_vectors(points, own)
        whole = pieces.sum(0)
        assert np.linalg.norm(whole) == pytest.approx(shoelace(outline), rel=1e-9)
        # With all of one sense, equal area means no overlap and nothing outside.
        assert (pieces @ whole >= -1e-9 * (whole @ whole)).all()


def test_non_convex_faces_are_tiled():
    assert_tiles([BOWTIE, COMB, SPIRAL, STRAIGHT, BOWTIE[2:] + BOWTIE[:2]])


@settings(max_examples=60, deadline=None)
@given(st.integers(3, 14), st.integers(0, 2**32 - 1))
def test_star_shaped_faces_are_tiled(sides, seed):
    rng = np.random.default_rng(seed)
    angles = 2 * np.pi * (np.arange(sides) + rng.uniform(-0.4, 0.4, sides)) / sides
    radii = rng.uniform(0.15, 1.0, sides)
    outline = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    if sides == 3 and shoelace(outline) <= 1e-3:
        return  # the angles of a triangle may leave its centre outside
    assert_tiles([outline])


def nearest_by_rays(points, width, height):
    """Which triangle is nearest at each pixel centre, by barycentric coordinates, one at a time."""
    seen = np.full((height, width), -1)
    depth = np.full((height, width), -np.inf)
    clear = np.full((height, width), np.inf)  # how far the decision is from being a tie
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    for k, corners in enumerate(points):
        matrix = np.vstack([corners[:, :2].T, np.ones(3)])
        weights = np.linalg.solve(matrix, np.stack([x.ravel(), y.ravel(), np.ones(x.size)]))
        inside = (weights >= 0).all(0).reshape(height, width)
        z = (corners[:, 2] @ weights).reshape(height, width)
        rim = np.abs(weights).min(0).reshape(height, width)
        clear = np.minimum(clear, np.minimum(rim, np.where(inside, np.abs(z - depth), np.inf)))
        nearer = inside & (z > depth)
        seen[nearer], depth[nearer] = k, z[nearer]
    return seen, depth, clear


def test_the_z_buffer_agrees_with_rays():
    rng = np.random.default_rng(5)
    points = np.concatenate(
        [rng.uniform(-15, 75, (60, 3, 2)), rng.uniform(0.05, 0.95, (60, 3, 1))], axis=2
    )
    seen, depth = rasterise(points, 64, 48)
    want, want_depth, clear = nearest_by_rays(points, 64, 48)
    sure = clear > 1e-5
    assert sure.mean() > 0.95
    assert (seen[sure] == want[sure]).all()
    covered = sure & (want >= 0)
    assert covered.mean() > 0.5
    np.testing.assert_allclose(depth[covered], want_depth[covered], atol=1e-8)


def test_pieces_of_a_triangle_leave_no_gap():
    corners = np.array([[3.2, 2.1, 0.3], [60.4, 9.7, 0.6], [21.8, 44.9, 0.5]])
    middle = corners.mean(0)
    pieces = np.array([[corners[k], corners[k - 2], middle] for k in range(3)])
    whole, _ = rasterise(corners[None], 64, 48)
    parts, _ = rasterise(pieces, 64, 48)
    assert ((whole >= 0) == (parts >= 0)).all()


def test_the_camera_goes_to_pixels_and_back():
    points = np.random.default_rng(1).normal(size=(200, 3)) * [3000.0, 1000.0, 500.0]
    camera = fit_camera(View(33.0, 20.0, 30.0), points, (800, 500), 0.05)
    x, y, depth = camera.project(points).T
    assert (x >= 0.05 * 800 - 1e-6).all() and (x <= 0.95 * 800 + 1e-6).all()
    assert (y >= 0.05 * 500 - 1e-6).all() and (y <= 0.95 * 500 + 1e-6).all()
    assert (depth > 0).all() and (depth < 1).all()
    back = camera.eye + camera.away(depth)[:, None] * camera.rays(x, y)
    np.testing.assert_allclose(back, points, atol=1e-6)
    nearest = np.linalg.norm(points - camera.eye, axis=1).argmin()
    assert depth[nearest] > np.median(depth)


def box(low, high):
    low, high = np.array(low, float), np.array(high, float)
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    faces = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return Solid(low + corners * (high - low), faces)


RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
FRONT = View(azimuth=-90.0, elevation=0.0, opening=20.0)  # the eye looks along +y


@pytest.mark.parametrize("order", [1, -1])
def test_what_stands_behind_is_hidden(order):
    wall = solid_layer("wall", ["W"], [box((-2, 0, -2), (2, 0.1, 2))], BLUE)
    behind = solid_layer("behind", ["B"], [box((-1, 3, -1), (1, 4, 1))], RED)
    image = picture([wall, behind][::order], (90, 90), FRONT, lights=0, supersample=1)
    assert (image[..., 3] > 0).mean() > 0.5
    assert image[..., 0].max() < 0.15  # nothing but ink has any red
    alone = picture([behind], (90, 90), FRONT, lights=0, supersample=1)
    assert alone[..., 0].max() > 0.4


def test_a_roof_casts_a_shadow():
    floor = solid_layer("floor", ["F"], [box((-3, -3, -0.1), (3, 3, 0))], (1.0, 1.0, 1.0))
    roof = solid_layer("roof", ["R"], [box((-1, -1, 1.2), (1, 1, 1.25))], BLUE)
    above = View(azimuth=-90.0, elevation=60.0, opening=12.0)
    frame = floor.vertices
    bright = picture([floor], (80, 80), above, supersample=1, framing=frame)
    dark = picture([floor, roof], (80, 80), above, supersample=1, framing=frame)
    white = dark[..., 0] > 0.9 * dark[..., 2]  # floor, not roof
    lost = (bright - dark)[..., 0][white & (bright[..., 3] > 0)]
    assert lost.max() > 0.2 and lost.min() > -0.02
    assert np.median(lost) < 0.1


def test_an_open_face_is_lit_from_both_sides():
    square = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], float)
    images = []
    for face in ((0, 1, 2, 3), (3, 2, 1, 0)):
        mesh = PolyMesh.from_faces(square, [face])
        layer = mesh_layer("shell", mesh, ["face 0"], np.ones((1, 3)))
        images.append(picture([layer], (40, 40), FRONT, supersample=1))
    np.testing.assert_allclose(images[0], images[1], atol=0.02)
    assert images[0][20, 20, 3] == 1


def test_what_lies_outside_the_frame_is_hidden_too():
    """A wall that reaches far beyond the frame stays behind the post in front of it."""
    wall = solid_layer("wall", ["W"], [box((-40, 6, -40), (40, 46, 40))], BLUE)
    post = solid_layer("post", ["P"], [box((-0.5, 0, -1), (0.5, 1, 1))], RED)
    frame = np.array([[-1, 0, -1], [1, 1, 1]], float)
    image = picture([post, wall], (60, 60), FRONT, lights=0, supersample=1, framing=frame)
    assert image[30, 30, 0] > 0.4 and image[30, 30, 2] < 0.1
    assert image[30, 5, 2] > 0.4 and image[30, 5, 0] < 0.1


def test_a_cut_panel_s_face_of_the_gauss_image_is_that_from_before_the_cut():
    smooth = surface("enneper").scaled(5000.0)
    whole = minimal_shell(smooth, lattice_on(smooth, 400.0), "face")
    z = smooth.parameter(0.5 * np.exp(2j * np.pi * np.arange(600) / 600))
    border = Border(smooth.point(z), smooth.normal(z), np.zeros(0, int))
    shell = cut_shell(whole, [border]).shell
    assert shell.rim_edges.any()
    drawn = gauss_mesh(shell)
    assert drawn.n_faces == shell.mesh.n_faces
    for face in range(drawn.n_faces):
        # In the plane of its panel's normal, at the distance that its type keeps.
        normal = shell.normals[shell.panels[face]]
        assert np.allclose(drawn.polygon(face) @ normal, 1.0)
    # None is a spike: no corner is farther from the sphere than the panels are large.
    assert np.linalg.norm(drawn.vertices[drawn.corners], axis=1).max() < 1.1
    assert gauss_mesh(whole) is whole.gauss
