"""Pictures as files, colours of panels, charts, and numbers as a reader sees them."""

import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PIL import Image
from report_samples import sample

from phexfab.errors import PhexError
from phexfab.mesh.measures import signed_areas
from phexfab.parallel.curvature import gaussian_curvatures
from phexfab.report.charts import bins, histogram, round_step
from phexfab.report.fields import NEUTRAL, RAMP, PanelField, panel_fields
from phexfab.report.figures import assembly_figure, gauss_figure, sheet_figure, shell_figure
from phexfab.report.pack import Packer
from phexfab.report.text import number, quantity

SMALL = (96, 64)


def flats():
    return {p.mark: p.flat for p in (*sample().parts.panels, *sample().parts.beams)}


FIGURES = {
    "shell": lambda: shell_figure(sample().shell, size=SMALL),
    "gauss": lambda: gauss_figure(sample().shell, size=SMALL),
    "assembly": lambda: assembly_figure(sample().parts, size=SMALL),
    "few colours": lambda: assembly_figure(sample().parts, size=SMALL, colours=16),
    "sheet": lambda: sheet_figure(sample().sheets[0], flats(), sample().engraving, width=96),
}


@pytest.mark.parametrize("kind", FIGURES)
def test_figures_are_the_same_twice_and_show_something(kind):
    data = FIGURES[kind]()
    assert FIGURES[kind]() == data
    with Image.open(io.BytesIO(data)) as image:
        image.load()
        assert image.format == "PNG" and image.width == 96
        assert not image.text  # no date, no version
        grey = np.asarray(image.convert("L"), float)
    assert grey.max() > 250 and grey.min() < 150
    assert 0.05 < (grey < 235).mean() < 0.95


def test_a_figure_is_written_where_asked(tmp_path):
    data = shell_figure(sample().shell, tmp_path / "shell.png", size=SMALL)
    assert (tmp_path / "shell.png").read_bytes() == data


def test_an_unknown_field_is_refused_by_name():
    with pytest.raises(PhexError, match=r"'weight'.*Panel area"):
        shell_figure(sample().shell, field="weight", size=SMALL)


def test_panels_are_coloured_by_what_is_named():
    shell = sample().shell
    fields = {field.name: field for field in panel_fields(shell)}
    np.testing.assert_allclose(
        fields["Gaussian curvature"].values, 1e6 * gaussian_curvatures(shell)
    )
    area = signed_areas(shell.mesh, shell.normals[shell.panels])
    np.testing.assert_allclose(fields["Panel area"].values, area / 1e6)
    for field in fields.values():
        place = field.positions
        assert place.min() == 0 and place.max() == 1
        assert (np.argsort(place) == np.argsort(field.values)).all()


def test_values_that_are_no_numbers_are_grey_and_equal_ones_are_equal():
    def code(colour):
        return "#" + "".join(f"{round(255 * c):02x}" for c in colour)

    mixed = PanelField("x", "mm", np.array([1.0, np.nan, 3.0, np.inf]))
    assert mixed.limits == (1.0, 3.0)
    assert [code(c) for c in mixed.colours] == [RAMP[0], NEUTRAL, RAMP[-1], NEUTRAL]
    same = PanelField("x", "mm", 0.3 + np.array([0.0, 1e-16, -1e-16]))
    assert len({code(c) for c in same.colours}) == 1


@pytest.mark.parametrize(
    "values",
    [
        np.random.default_rng(2).normal(200.0, 30.0, 5000),
        np.array([0.1, 0.2, 0.3]),
        np.array([-3.0, 4.5, 4.5, 1e3]),
        np.full(7, 2.5),
        np.zeros(3),
        1e-12 * np.arange(50.0),
    ],
)
def test_bins_hold_every_value_once(values):
    edges, counts = bins(values)
    assert counts.sum() == len(values) and len(counts) == len(edges) - 1 <= 30
    assert edges[0] <= values.min() and edges[-1] >= values.max()
    np.testing.assert_allclose(np.diff(edges), edges[1] - edges[0], rtol=1e-9)
    # Away from the edges, where rounding cannot decide, numpy finds the same.
    width = edges[1] - edges[0]
    inner = np.abs((values - edges[0]) / width - np.rint((values - edges[0]) / width)) > 1e-6
    np.testing.assert_array_less(np.histogram(values[inner], edges)[0] - 0.5, counts)


def test_steps_are_round():
    assert [round_step(x) for x in (1.0, 1.1, 2.2, 3.0, 7.0)] == [1.0, 2.0, 2.5, 5.0, 10.0]
    assert round_step(0.013) == pytest.approx(0.02)


def test_a_histogram_counts_what_it_leaves_out():
    text = histogram("a <b>", np.array([1.0, 2.0, np.nan, np.inf]), "mm")
    assert "2 not a number" in text and "A &lt;b&gt;" in text
    bars = ET.fromstring(re.search(r"<svg.*</svg>", text, re.S)[0]).findall(".//rect")
    assert [float(bar.get("height")) > 0 for bar in bars] == [True, True]
    assert "no values" in histogram("empty", np.zeros(0), "mm")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (304, "304"),
        (12345, "12\u202f345"),
        (-1390.0, "−1390"),
        (0.0, "0"),
        (2275.67374, "2276"),
        (0.036203, "0.0362"),
        (float("nan"), "not a number"),
        (float("inf"), "∞"),
        ("edge", "edge"),
    ],
)
def test_numbers_read_well(value, text):
    assert number(value) == text


def test_powers_of_ten_are_raised():
    mantissa, power = re.fullmatch(r"([\d.]+) × 10(.+)", number(1.868e-15)).groups()
    assert float(mantissa) == pytest.approx(1.87, abs=0.04) and power == "⁻¹⁵"
    assert quantity(60.5, "deg") == "60.5°" and quantity(0.5, "1") == "0.5"


def test_data_that_json_does_not_know_is_refused():
    with pytest.raises(ValueError, match="JSON"):
        Packer().pack({"a": float("nan")})
