"""Rims from tables of points."""

import numpy as np
import pytest

from phexfab.errors import DesignError
from phexfab.surface.rims.table import read_rim_csv

QUAD = [[0, 0, 0], [12000, 0, 3000], [12000, 9000, 0.5], [0, 9000, 4000]]


def written(tmp_path, text, name="rim.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def table(rows, separator=",", decimal="."):
    return "\n".join(
        separator.join(str(value).replace(".", decimal) for value in row) for row in rows
    )


@pytest.mark.parametrize(
    ("separator", "decimal"),
    [(",", "."), (";", "."), (";", ","), ("\t", ","), ("\t", "."), (" ", ".")],
)
def test_separators_and_decimal_commas(tmp_path, separator, decimal):
    (rim,) = read_rim_csv(written(tmp_path, table(QUAD, separator, decimal)))
    assert rim.point(rim.corners) == pytest.approx(np.array(QUAD), abs=1e-9)
    assert rim.name == "rim.csv"


def test_header_in_any_order_with_a_unit_and_a_mark(tmp_path):
    text = "\ufeff# surveyed\nid;Z [m];x_m;Y (m)\n" + "\n".join(
        f"P{k};{z / 1000};{x / 1000};{y / 1000}" for k, (x, y, z) in enumerate(QUAD)
    )
    (rim,) = read_rim_csv(written(tmp_path, text))
    assert rim.point(rim.corners) == pytest.approx(np.array(QUAD), abs=1e-9)
    (feet,) = read_rim_csv(written(tmp_path, text), unit="ft")
    assert feet.length == pytest.approx(0.3048 * rim.length, rel=1e-12)


def ring(radius, height, n=24):
    a = 2 * np.pi * np.arange(n) / n
    return np.stack([radius * np.cos(a), radius * np.sin(a), height + 0 * a], axis=1).tolist()


def test_several_curves_by_blank_line_or_column(tmp_path):
    one, two = ring(3000, 0), ring(2000, 1500)
    blank = written(tmp_path, "x,y,z\n" + table(one) + "\n\n,,\n" + table(two) + "\n\n")
    lower, upper = read_rim_csv(blank)
    assert (lower.name, upper.name) == ("rim.csv:1", "rim.csv:2")
    mixed = [row for a, b in zip(one, two, strict=True) for row in ([*a, "eaves"], [*b, "eye"])]
    column = written(tmp_path, "x,y,z,rim\n" + table(mixed))
    eaves, eye = read_rim_csv(column)
    assert (eaves.name, eye.name) == ("rim.csv:eaves", "rim.csv:eye")
    assert eaves.length == pytest.approx(lower.length, rel=1e-14)
    assert eye.length == pytest.approx(upper.length, rel=1e-14)
    assert len(eye.corners) == 0


def test_corners_by_column_by_rule_and_smoothed(tmp_path):
    rows = [[*row, mark] for row, mark in zip(QUAD, ["1", "0", "yes", ""], strict=True)]
    (marked,) = read_rim_csv(written(tmp_path, "x,y,z,corner\n" + table(rows)))
    assert marked.point(marked.corners) == pytest.approx(np.array(QUAD)[[0, 2]], abs=1e-9)
    path = written(tmp_path, table([*QUAD, QUAD[0]]))  # closed by repeating the first point
    (rim,) = read_rim_csv(path)
    assert len(rim.corners) == 4
    (none,) = read_rim_csv(path, corner_angle=180.0)
    assert len(none.corners) == 0
    (soft,) = read_rim_csv(path, smooth=1000.0)
    assert len(soft.corners) == 0
    assert 0.0 < rim.length - soft.length < 4 * 2 * 1000.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "rim.csv: there are no points"),
        ("x,y,z\n", "a header but there are no points"),
        ("1,2\n3,4\n", "line 1: 2 columns without a header"),
        ("a,b,z\n1,2,3\n", "line 1: no column x, y among a, b, z"),
        ("x,y,z,x\n1,2,3,4\n", "two columns are called 'x'"),
        ("x [m],y [ft],z\n1,2,3\n", "units ft, m in the header"),
        ("0,0,0\n9000,0,abc\n", "line 2: z = 'abc' is no number"),
        ("0;0;0\n9.000,5;0;1\n", "line 2: x = '9.000,5' is no number"),
        ("0,0,0\n# note\n9000,nan,1\n", "line 3: y = nan; every coordinate must be finite"),
        ("0,0,0\n9000,0\n", "line 2: 2 cells"),
        ("x,y,z,corner\n1,2,3,maybe\n", "line 2: corner = 'maybe'; write 1 or 0"),
        ("0,0,0\n9000,0,0\n", r"2 points; .* \(lines 1 to 2"),
        ("0,0,0\n9000,0,0\n9000,0,0\n0,9000,0\n", r"points 1 and 2 are both at \(9000, 0, 0\)"),
        ("0,0,0\n9,0,0\n0,9,0\n", "probably in m: say unit = 'm'"),
        ("0,0,0\n9000,9000,0\n9000,0,0\n0,9000,0\n", r"crosses .* near \(4500, 4500, 0\)"),
    ],
)
def test_tables_that_are_refused(tmp_path, text, message):
    with pytest.raises(DesignError, match=message):
        read_rim_csv(written(tmp_path, text))


def test_files_that_are_no_text(tmp_path):
    with pytest.raises(DesignError, match=r"absent\.csv: there is no such file; check the path"):
        read_rim_csv(tmp_path / "absent.csv")
    (tmp_path / "rim.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(DesignError, match="cannot be read as text"):
        read_rim_csv(tmp_path / "rim.csv")


def test_touching_rims_of_one_table_are_named(tmp_path):
    text = table(ring(3000, 0)) + "\n\n" + table(ring(3000, 0, 36))
    with pytest.raises(DesignError, match=r"rim.csv:1 and rim.csv:2"):
        read_rim_csv(written(tmp_path, text))
