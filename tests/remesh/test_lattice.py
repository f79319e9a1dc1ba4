"""The triangular lattice: regular, oriented, inside its rectangle, closing exactly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phexfab.errors import LatticeError
from phexfab.parallel.rings import border_loops, face_rings
from phexfab.remesh.lattice import check_directions, lattice
from phexfab.triangular import EQUILATERAL, mean_distance

PERIOD = 2j * np.pi


def edge_vectors(made, period=None):
    w = made.points[made.triangles]
    e = np.roll(w, -1, axis=1) - w
    if period is not None:
        turns = np.round((e * np.conj(period)).real / abs(period) ** 2)
        e = e - turns * period
    return e


@settings(max_examples=40, deadline=None)
@given(
    width=st.floats(1, 4),
    height=st.floats(1, 4),
    step=st.floats(0.1, 0.3),
    ratio=st.floats(0.6, 1.5),
    along=st.sampled_from("uv"),
    turn=st.floats(-3, 3),
)
def test_open_lattice_is_regular_oriented_and_inside(width, height, step, ratio, along, turn):
    box = (0.5, 0.5 + width, -1.0, -1.0 + height)
    made = lattice(box, step, row_ratio=ratio, rows_along=along, turn=turn)
    e = edge_vectors(made)
    slanted = step * np.hypot(0.5, ratio)
    assert np.allclose(np.sort(np.abs(e), axis=1)[:, :1].min(), min(step, slanted), rtol=1e-12)
    row = np.where(made.upward[:, None], np.array([1, 0, 0]), np.array([0, 1, 0])).astype(bool)
    assert np.allclose(np.abs(e[row]), step, rtol=1e-12)
    assert np.allclose(np.abs(e[~row]), slanted, rtol=1e-12)
    area = (e[:, 0].conj() * (-e[:, 2])).imag / 2
    assert np.allclose(area, step * step * ratio / 2, rtol=1e-12)
    direction = np.angle(e[row]) - (np.pi / 2 if along == "v" else 0) - np.radians(turn)
    assert np.allclose(np.sin(direction), 0, atol=1e-9)
    assert made.points.real.min() >= box[0] - 1e-9 and made.points.real.max() <= box[1] + 1e-9
    assert made.points.imag.min() >= box[2] - 1e-9 and made.points.imag.max() <= box[3] + 1e-9


def test_panels_have_six_sides_and_every_border_plane_touches_one():
    made = lattice((-1, 1, -1, 1), 0.2)
    panels, starts, _, neighbours = face_rings(made.triangles, len(made.points))
    assert set(np.diff(starts)) == {6}
    border = np.setdiff1d(np.arange(len(made.points)), panels)
    assert np.isin(border, neighbours).all()
    assert len(border_loops(made.triangles, panels, len(made.points))) == 1


@pytest.mark.parametrize("along", ["u", "v"])
@pytest.mark.parametrize("step", [0.07, 0.2, 0.5])
def test_closed_lattice_goes_around_exactly(along, step):
    made = lattice((-1, 1, 0, 1), step, rows_along=along, period=PERIOD)
    e = edge_vectors(made, PERIOD)
    area = (e[:, 0].conj() * (-e[:, 2])).imag / 2
    assert np.allclose(area, area[0], rtol=1e-11) and area[0] > 0
    around = abs(PERIOD) / made.step / (1 if along == "v" else EQUILATERAL)
    assert abs(around - round(around)) < 1e-9
    if along == "u":
        assert round(around) % 2 == 0
    panels = face_rings(made.triangles, len(made.points))[0]
    assert len(border_loops(made.triangles, panels, len(made.points))) == 2
    # Euler's characteristic of a ring of triangles.
    pairs = np.sort(np.vstack([made.triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    edges = np.unique(pairs, axis=0)
    assert len(made.points) - len(edges) + len(made.triangles) == 0


@pytest.mark.parametrize(
    ("ratio", "turn", "fine"),
    [(EQUILATERAL, 0, True), (EQUILATERAL, 15, False), (EQUILATERAL, 14, False),
     (EQUILATERAL, 30, True), (0.5, 0, False), (0.6, 0, True), (3.0, 0, True), (3.0, 45, False)],
)  # fmt: skip
def test_asymptotic_directions_are_refused(ratio, turn, fine):
    if fine:
        check_directions(ratio, turn)
    else:
        with pytest.raises(LatticeError, match=r"asymptotic.*row_ratio above 0\.5"):
            check_directions(ratio, turn)


def test_errors_name_key_value_and_remedy():
    with pytest.raises(LatticeError, match=r"no panel fits.*panel_size"):
        lattice((0, 1, 0, 1), 0.9)
    with pytest.raises(LatticeError, match="rows_along = 'w'"):
        lattice((0, 1, 0, 1), 0.1, rows_along="w")
    with pytest.raises(LatticeError, match=r"turn = 2°.*cannot be turned"):
        lattice((0, 1, 0, 1), 0.1, turn=2, period=PERIOD)
    with pytest.raises(LatticeError, match="positive"):
        lattice((0, 1, 0, 1), float("nan"))
    with pytest.raises(LatticeError, match="empty"):
        lattice((1, 0, 0, 1), 0.1)
    with pytest.raises(LatticeError, match="principal direction"):
        lattice((0, 1, 0, 1), 0.1, period=1 + 1j)


def test_mean_distance_is_one_where_equilateral():
    assert mean_distance(EQUILATERAL) == pytest.approx(1, abs=1e-15)
