"""Pictures from code: what the axes hold, measured; and the poster, the same twice."""

import io
import re
from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace
from unittest.mock import patch

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.colors import to_rgb
from matplotlib.image import imread
from report_samples import sample

from phexfab.design import make_design
from phexfab.errors import PhexError
from phexfab.fabrication.layout import placed
from phexfab.fabrication.parts import CheckResult
from phexfab.forming import panel_sizes
from phexfab.mesh.measures import planarity
from phexfab.plots import plot_checks, plot_gauss, plot_sheet, plot_shell, poster
from phexfab.plots.shells import NAMES, panel_field
from phexfab.report.camera import View
from phexfab.report.fields import RAMP, PanelField, panel_fields
from phexfab.surface.catalog import surface
from phexfab.surface.freeform.implicit import implicit

UP = View(azimuth=-90.0, elevation=90.0, opening=0.5)  # from above: x to the right, y upwards


@dataclass(frozen=True, eq=False)
class Made:
    """What the plots take from a build."""

    shell: object
    parts: object
    sheets: tuple
    checks: tuple
    surface: object
    design: object


@lru_cache(maxsize=1)
def build():
    data = sample()
    keys = {"surface": {"name": "enneper"}, "lattice": {"panel_size": 700}, "title": "A & <b> roof"}
    smooth = surface("enneper").scaled(3000.0)
    return Made(data.shell, data.parts, data.sheets, data.checks, smooth, make_design(keys))


@pytest.fixture(autouse=True)
def closed():
    yield
    pyplot.close("all")


def picture_of(ax):
    (image,) = ax.get_images()
    return np.asarray(image.get_array()), np.array(image.get_extent())


def test_lengths_in_the_axes_are_true():
    """From above, the picture's bounds are those of the parts; the bar is as long as it says."""
    ax = plot_shell(build(), view=UP, pixels=500)
    image, (left, right, low, high) = picture_of(ax)
    seen = np.argwhere(image[..., 3] > 0.5)
    pixel = (right - left) / image.shape[1]
    assert (high - low) / image.shape[0] == pytest.approx(pixel)
    parts = build().parts
    drums = [n.cylinder for n in parts.nodes]
    rims = [
        d.base + s * d.axis * d.length + t * d.radius * np.sqrt(1 - d.axis**2)
        for d in drums
        for s in (0, 1)
        for t in (-1, 1)
    ]
    points = np.concatenate([*(p.solid.vertices for p in (*parts.panels, *parts.beams)), rims])
    wide = (seen[:, 1].max() - seen[:, 1].min() + 1) * pixel
    tall = (seen[:, 0].max() - seen[:, 0].min() + 1) * pixel
    # A lens of half a degree makes what is nearer larger by some parts in a thousand.
    assert [wide, tall] == pytest.approx(np.ptp(points, axis=0)[:2], rel=0.006, abs=2 * pixel)
    bar = ax.lines[0].get_xdata()
    said = next(t.get_text() for t in ax.texts).replace("\u00a0", " ").split()
    assert bar.max() - bar.min() == pytest.approx(float(said[0]) * {"m": 1e3, "mm": 1}[said[1]])


def test_what_is_nearer_hides_what_is_farther():
    """Where rays through the panels' middles first meet a panel, the picture has its colour."""
    shell = build().shell
    number = np.arange(shell.mesh.n_faces, dtype=float)
    field = PanelField("Number", "1", number)
    view = View(azimuth=20.0, elevation=12.0, opening=0.05)
    with patch("phexfab.plots.shells.panel_field", lambda *_: field):
        ax = plot_shell(shell, by="number", view=view, pixels=700)
    image, (left, right, low, high) = picture_of(ax)
    stops = np.array([to_rgb(code) for code in RAMP])
    frame = _frame(20.0, 12.0)
    middle = (shell.mesh.vertices.min(0) + shell.mesh.vertices.max(0)) / 2
    flat = [(shell.mesh.polygon(f) - middle) @ frame.T for f in range(shell.mesh.n_faces)]
    hidden = 0
    for face, corners in enumerate(flat):
        spot = corners.mean(0)[:2]
        depths = [_depth(other, spot) for other in flat]
        nearest = int(np.argmax(depths))
        others = sorted(depths)[-2]
        if np.isinf(depths[face]) or depths[nearest] - others < 20.0:
            continue  # not convex there, or two panels meet
        hidden += nearest != face
        column = int((spot[0] - left) / (right - left) * image.shape[1])
        row = int((high - spot[1]) / (high - low) * image.shape[0])
        place = nearest / (len(flat) - 1) * (len(RAMP) - 1)
        want = np.array([np.interp(place, np.arange(len(RAMP)), stops[:, k]) for k in range(3)])
        got = image[row, column, :3]
        # Light scales a colour; its hue stays.
        np.testing.assert_allclose(got / got.sum(), want / want.sum(), atol=0.02)
    assert hidden > 0.1 * len(flat)


def _frame(azimuth, elevation):
    """Rows: to the right, upwards, towards the eye."""
    a, e = np.radians([azimuth, elevation])
    back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.array([right, np.cross(back, right), back])


def _depth(corners, spot):
    """How near the eye a polygon is at a spot of the picture; −∞ where it is not."""
    if not _inside(corners[:, :2], spot):
        return -np.inf
    matrix = np.column_stack([corners[:, :2], np.ones(len(corners))])
    plane = np.linalg.lstsq(matrix, corners[:, 2], rcond=None)[0]
    return float(plane @ [*spot, 1.0])


def _inside(polygon, point):
    x, y = (polygon - point).T
    after_x, after_y = np.roll(x, -1), np.roll(y, -1)
    turn = np.arctan2(x * after_y - y * after_x, x * after_x + y * after_y).sum()
    return abs(turn) > np.pi


def test_colours_are_what_they_are_named_after():
    made, shell = build(), build().shell
    fields = {field.name: field.values for field in panel_fields(shell)}
    np.testing.assert_array_equal(
        panel_field(made, "gaussian").values, fields["Gaussian curvature"]
    )
    np.testing.assert_array_equal(panel_field(made, "Mean edge").values, fields["Mean edge"])
    np.testing.assert_array_equal(panel_field(made, "size").values, panel_sizes(shell))
    np.testing.assert_array_equal(panel_field(made, "planarity").values, planarity(shell.mesh))
    assert panel_field(made, "sides").values.tolist() == [
        len(p.flat.outline) for p in made.parts.panels
    ]
    assert panel_field(made, "mass").values.tolist() == [p.mass for p in made.parts.panels]
    for name in NAMES[1:]:
        assert len(panel_field(made, name).values) == shell.mesh.n_faces


def test_the_deviation_is_the_distance_from_the_surface():
    """A shell near a plane, so that the distance is the height; on any kind of smooth surface."""
    shell = build().shell
    up = np.array([0.0, 0.0, 1.0])
    box = (shell.mesh.vertices.min(0) - 900, shell.mesh.vertices.max(0) + 900)
    plane = implicit(
        lambda p: p[..., 2],
        lambda p: np.broadcast_to(up, p.shape),
        lambda p: np.zeros((*p.shape, 3)),
        box,
    )
    made = SimpleNamespace(shell=shell, surface=plane, parts=build().parts)
    high = np.abs(shell.mesh.vertices[:, 2])
    want = [high[list(face)].max() for face in shell.mesh.faces]
    np.testing.assert_allclose(panel_field(made, "deviation").values, want, rtol=1e-6)
    with pytest.raises(PhexError, match="given mesh"):
        panel_field(SimpleNamespace(shell=shell, surface=None), "deviation")


@pytest.mark.parametrize(
    ("thing", "by", "words"),
    [
        (lambda: build(), "weight", r"'weight' is unknown.*gaussian.*Panel area"),
        (lambda: build().shell, "family", "needs a build"),
        (lambda: build().shell, "mass", "needs a build"),
    ],
)
def test_what_cannot_be_drawn_is_refused_by_name(thing, by, words):
    with pytest.raises(PhexError, match=words):
        plot_shell(thing(), by=by, pixels=60)


def test_a_colour_bar_says_what_and_in_which_unit():
    ax = plot_shell(build().shell, by="area", pixels=120)
    bar = next(other for other in ax.figure.axes if other is not ax)
    assert bar.get_ylabel() == "Panel area, m²"
    low, high = panel_field(build().shell, "area").limits
    assert bar.get_ylim() == pytest.approx((low, high))
    # Rounding errors get a scale around their value, not one that blows them up.
    ax = plot_shell(build().shell, by="sides", pixels=120)
    low, high = next(other for other in ax.figure.axes if other is not ax).get_ylim()
    assert low < 6 < high and high - low > 1


def test_plots_draw_where_they_are_told():
    axes = pyplot.subplots(2, 2, figsize=(8, 6))[1].ravel()
    drawn = (
        plot_shell(build(), axes[0], pixels=120),
        plot_gauss(build(), axes[1], pixels=100),
        plot_sheet(build(), 0, axes[2], engraving=False),
        plot_checks(build(), axes[3]),
    )
    assert list(drawn) == list(axes)
    for ax in drawn[:3]:
        assert ax.get_aspect() == 1.0
    names = [text.get_text() for text in drawn[0].get_legend().get_texts()]
    parts = build().parts
    assert names == [
        f"{len(parts.panels)} panels", f"{len(parts.beams)} beams", f"{len(parts.nodes)} nodes",
    ]  # fmt: skip
    drawn[0].figure.canvas.draw()


def test_the_gauss_image_has_the_sphere_s_units():
    ax = plot_gauss(build(), pixels=300)
    image, (left, right, *_) = picture_of(ax)
    across = np.flatnonzero((image[..., 3] > 0.3).any(0))
    wide = (across[-1] - across[0] + 1) * (right - left) / image.shape[1]
    assert wide == pytest.approx(2.0, abs=0.03)


def test_a_sheet_shows_each_part_where_it_is_cut():
    sheet = build().sheets[0]
    flats = {p.mark: p.flat for p in (*build().parts.panels, *build().parts.beams)}
    ax = plot_sheet(build(), sheet.name)
    cut = [path.vertices[:-1] for path in ax.collections[1].get_paths()]
    assert len(cut) == len(sheet.placements)
    for points, spot in zip(cut, sheet.placements, strict=True):
        np.testing.assert_allclose(points, placed(flats[spot.mark].outline, spot), atol=1e-9)
    assert len(ax.collections[2].get_paths()) > len(sheet.placements)  # marks and ticks
    assert ax.get_xlabel() == "mm" and sheet.name in ax.get_title(loc="left")
    for same in (0, sheet):
        assert len(plot_sheet(build(), same).collections[1].get_paths()) == len(cut)
    with pytest.raises(PhexError, match=f"no sheet 99; it has {len(build().sheets)}: {sheet.name}"):
        plot_sheet(build(), 99)


def test_a_bar_passes_the_line_exactly_when_its_check_fails():
    def check(value, limit, sense="<="):
        return CheckResult("some_check", value, limit, "mm", sense)

    checks = (
        check(1.0, 2.0), check(3.0, 2.0), check(0.0, 0.0), check(1.0, 0.0), check(-5.0, 0.0),
        check(4.0, 2.0, ">="), check(1.0, 2.0, ">="), check(-1.0, 2.0, ">="), check(0.0, 0.0, ">="),
        check(float("nan"), 2.0), check(1e-20, 1e-12), check(2.0, 2.0),
    )  # fmt: skip
    ax = plot_checks(SimpleNamespace(checks=checks))
    for bar, one in zip(ax.patches, checks, strict=True):
        end = bar.get_x() + bar.get_width()
        assert (end > 1.0 + 1e-9) is not one.ok, one
    assert ax.patches[0].get_x() + ax.patches[0].get_width() == pytest.approx(0.5)
    assert ax.patches[5].get_x() + ax.patches[5].get_width() == pytest.approx(0.5)
    assert [text.get_text() for text in ax.get_yticklabels()] == ["Some check"] * len(checks)
    assert len(ax.texts) == len(checks)


@pytest.fixture
def coarse():
    """The poster with a dot where it has twenty-five: its pictures take most of the time."""
    with patch("phexfab.plots.posters.DPI", 40):
        yield


@pytest.mark.parametrize("ending", [".png", ".pdf", ".svg"])
def test_a_poster_is_the_same_twice_whatever_the_reader_s_settings(tmp_path, ending, coarse):
    poster(build(), tmp_path / f"a{ending}")
    with mpl.rc_context({"font.size": 30, "axes.facecolor": "red", "savefig.bbox": "tight"}):
        assert poster(build(), tmp_path / f"b{ending}") == tmp_path / f"b{ending}"
        assert mpl.rcParams["font.size"] == 30
    first = (tmp_path / f"a{ending}").read_bytes()
    assert first == (tmp_path / f"b{ending}").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"a{ending}", f"b{ending}"]
    assert not re.search(rb"(?i)matplotlib|20\d\d-\d\d-\d\d|D:20\d{6}", first)
    if ending == ".pdf":
        assert b"/MediaBox [ 0 0 1190.55" in first  # A3 across, in points


def test_a_poster_has_words_a_shell_and_a_sheet(tmp_path):
    """At its full size: A3 at 200 dots per inch, with something in each of its places."""
    with patch("phexfab.plots.posters.picture", _grey):
        poster(build(), tmp_path / "roof.png")
    image = imread(io.BytesIO((tmp_path / "roof.png").read_bytes()))[..., :3]
    assert image.shape[:2] == (2338, 3307)
    tall, wide = image.shape[:2]

    def ink(x0, x1, y0, y1):  # share of a box, measured from the upper left, that is not white
        box = image[int(y0 * tall) : int(y1 * tall), int(x0 * wide) : int(x1 * wide)]
        return float((box.min(-1) < 0.9).mean())

    assert ink(0.04, 0.5, 0.05, 0.14) > 0.02  # the name
    assert ink(0.05, 0.7, 0.2, 0.8) > 0.5  # the shell
    assert ink(0.75, 0.96, 0.2, 0.45) > 0.2  # the Gauss image
    assert ink(0.74, 0.96, 0.6, 0.8) > 0.1  # the sheet
    assert ink(0.04, 0.96, 0.86, 0.93) > 0.01  # key figures
    assert ink(0, 0.03, 0, 1) == ink(0.97, 1, 0, 1) == 0  # the rim


def _grey(layers, size, view, **options):
    return np.full((size[1], size[0], 4), [0.3, 0.3, 0.3, 1.0])


def test_a_poster_of_another_kind_is_refused(tmp_path):
    with pytest.raises(PhexError, match=r"ends in \.png, \.pdf or \.svg; roof\.jpg does not"):
        poster(build(), tmp_path / "roof.jpg")
    assert list(tmp_path.iterdir()) == []
