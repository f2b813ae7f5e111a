"""Readers of text: separators, decimal marks, labels, units, points on and off a grid, SDF."""

import subprocess
import sys
import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capslip.errors import (
    UncalibratedError,
    UnreadableFileError,
    UnusableSurfaceError,
)
from capslip.surface.heightmap import Statement
from capslip.surface.readers import load_surface
from capslip.surface.readers.points import grid_points

CALIBRATION = {"unit": "um", "pixel_size": (2.0, 1.0), "lateral_unit": "mm"}
LENGTHS = {"unit": "um", "lateral_unit": "mm"}
MAP = np.round(np.random.default_rng(3).normal(size=(6, 8)), 4)


def put(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def rows(values=MAP, separator=" ", decimal="."):
    lines = (separator.join(f"{v:.4f}".replace(".", decimal) for v in row) for row in values)
    return "\n".join(lines) + "\n"


def points_of(heights=MAP, dy=2.0, dx=1.0):
    i, j = np.indices(heights.shape)
    return np.column_stack([dx * j.ravel(), dy * i.ravel(), heights.ravel()])


# --- matrices and CSV ---


@pytest.mark.parametrize(
    ("separator", "decimal"),
    [(" ", "."), ("\t", "."), (",", "."), (", ", "."), (";", "."), (";", ","), ("\t", ",")],
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_separators_and_decimal_marks(tmp_path, separator, decimal, end):
    text = rows(separator=separator, decimal=decimal).replace("\n", end)
    surface = load_surface(put(tmp_path / "m.csv", text), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)
    assert surface.pixel_size_m == (2e-3, 1e-3)
    assert any("decimal commas" in note for note in surface.origin.notes) == (decimal == ",")
    assert all(isinstance(note, Statement) for note in surface.origin.notes)


@pytest.mark.parametrize("before", ["", "sep=;\n", "# 1.5 mm, 2.5 mm\n"])
@pytest.mark.parametrize("quote", ["", '"'])
@pytest.mark.parametrize("extension", ["csv", "txt"])
def test_a_spreadsheet_with_decimal_commas(tmp_path, before, quote, extension):
    lines = [";".join(f"{quote}{v:.4f}{quote}" for v in row) for row in MAP]
    text = before + "\n".join(lines).replace(".", ",") + "\n"
    surface = load_surface(put(tmp_path / f"m.{extension}", text), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)
    assert any("decimal commas" in note for note in surface.origin.notes)


@pytest.mark.parametrize("separator", [";", "\t", "  "])
@pytest.mark.parametrize("decimal", [",", "."])
def test_three_decimals_are_no_thousands(tmp_path, separator, decimal):
    """Heights that have as many digits each, and points on whole steps."""
    heights = 7.0 + np.abs(np.round(MAP, 3))
    text = "\n".join(separator.join(f"{v:.3f}" for v in row) for row in heights) + "\n"
    surface = load_surface(put(tmp_path / "m.csv", text.replace(".", decimal)), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * heights, rtol=1e-12)
    points = points_of(heights)
    text = "".join(f"{x:g}{separator}{y:g}{separator}{z:.3f}\n" for x, y, z in points)
    surface = load_surface(put(tmp_path / "p.csv", text.replace(".", decimal)), **LENGTHS)
    np.testing.assert_allclose(surface.height_m, 1e-6 * heights, rtol=1e-12)


@pytest.mark.parametrize("decimal", [",", "."])
@pytest.mark.parametrize("other", ["1.25", "0.123", "12.3456", "1234.567", "1.234e-3", "01.234"])
def test_one_number_that_cannot_be_grouped_tells_a_decimal_mark(tmp_path, decimal, other):
    """A writer that leaves out zeros at the end writes whole numbers beside 1.018."""
    text = "# c\n\n9.111;1.018;-22.345;7\n8.222;{};5.001;-9\n7.333;3;7;6\n"
    for word in ("3.125", "300"):
        with pytest.raises(UnreadableFileError, match=f"1{decimal}234 may be 1.234 or"):
            load_surface(
                put(tmp_path / "m.txt", text.format(word).replace(".", decimal)), **CALIBRATION
            )
    read = text.format(other).replace(".", decimal)
    surface = load_surface(put(tmp_path / "m.txt", read), **CALIBRATION)
    expected = [[9.111, 1.018, -22.345, 7], [8.222, float(other), 5.001, -9], [7.333, 3, 7, 6]]
    np.testing.assert_allclose(surface.height_m, 1e-6 * np.array(expected), rtol=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "  5, 30,100,200\n-12,113,  0,  9\n  7,  8,112,-13\n",  # blanks fill columns up
        "  5, 30,  0,-12\n  6, 31,  0,-13\n  7, 32,  0,-14\n",
        " 5.25, 30.50,100.75, 1.50\n 6.50, 31.25,101.25, 1.25\n 7.75, 32.50,102.50, 1.75\n",
        "129, 2.004, 558, 1\n1.197, -1.41, 138, 2\n-312, 1.614, 509, 3\n",  # -1.41 tells
        "129, 2.004, 558, 1\n312, 1.414, 138, 2\n-312, 1.614, 509, 3\n",  # no column has both
        "1, 2, 3, 4\n4,5,6,7\n7, 8, 9, 9\n",
    ],
)
def test_commas_and_blanks_that_can_mean_one_thing_alone_separate(tmp_path, text):
    expected = [[float(word) for word in line.split(",")] for line in text.splitlines()]
    surface = load_surface(put(tmp_path / "m.csv", text), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * np.array(expected), rtol=1e-12)


def test_blanks_with_decimal_commas(tmp_path):
    surface = load_surface(put(tmp_path / "m.txt", rows(decimal=",")), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)


def test_unit_and_pixel_size_are_asked_for(tmp_path):
    path = put(tmp_path / "m.csv", rows(separator=","))
    with pytest.raises(UncalibratedError, match="--unit"):
        load_surface(path)
    with pytest.raises(UncalibratedError, match="--pixel-size"):
        load_surface(path, unit="um")


def test_comments_empty_fields_and_nan_are_no_heights(tmp_path):
    text = "# made by hand\n% twice\n\n1,2,3,4,\n5,,7,nan,\n,9,8,7,\n"
    surface = load_surface(put(tmp_path / "m.csv", text), **CALIBRATION)
    nan = np.nan
    expected = [[1, 2, 3, 4], [5, nan, 7, nan], [nan, 9, 8, 7]]
    np.testing.assert_allclose(surface.height_m, 1e-6 * np.array(expected))


def test_last_field_of_a_row_may_be_empty(tmp_path):
    surface = load_surface(put(tmp_path / "m.csv", "1;2;3;4\n4;5;6;\n7;8;9;7\n"), **CALIBRATION)
    assert np.isnan(surface.height_m[1, 3])
    assert np.isnan(surface.height_m).sum() == 1


@pytest.mark.parametrize("separator", ["\t", ";", ","])
@pytest.mark.parametrize("end", ["\n", ""])
def test_a_separator_behind_every_row_ends_no_field(tmp_path, separator, end):
    text = rows(separator=separator).replace("\n", f"{separator}\n").removesuffix("\n") + end
    surface = load_surface(put(tmp_path / "m.txt", text), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)


@pytest.mark.parametrize("separator", ["\t", ";", ",", " ; "])
@pytest.mark.parametrize("trailing", [False, True])
@pytest.mark.parametrize(("around", "between"), [("", ""), ("\n", "\n"), (" \n\n", "")])
def test_rows_of_empty_fields_are_not_measured(tmp_path, separator, trailing, around, between):
    """The first and the last rows of a map as others; the first measured row has one number."""
    heights = MAP.copy()
    heights[[0, 1, 4, 5]] = heights[2, 1:] = heights[3, 0] = np.nan
    body = rows(heights, separator).replace("nan", "")
    if trailing:
        body = body.replace("\n", separator.strip(" ") + "\n")
    text = "# c\n" + around + body.replace("\n", "\n" + between) + around
    surface = load_surface(put(tmp_path / "m.txt", text), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * heights, rtol=1e-15)


@pytest.mark.parametrize("separator", ["\t", ";", ","])
def test_a_row_that_begins_with_three_numbers_is_no_point(tmp_path, separator):
    heights = MAP.copy()
    heights[0, 3:] = np.nan
    text = rows(heights, separator).replace("nan", "")
    surface = load_surface(put(tmp_path / "m.txt", text), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * heights, rtol=1e-15)


def test_one_number_at_the_end_of_a_row_tells_that_tabs_separate(tmp_path):
    text = "\t\t\t\n\t\t\t7\n1\t2\t3\t4\n4\t3\t1\t2\n"
    surface = load_surface(put(tmp_path / "m.txt", text), **CALIBRATION)
    nan = np.nan
    expected = [[nan] * 4, [nan, nan, nan, 7], [1, 2, 3, 4], [4, 3, 1, 2]]
    np.testing.assert_allclose(surface.height_m, 1e-6 * np.array(expected), rtol=1e-15)


@pytest.mark.parametrize("separator", ["\t", ","])
def test_a_map_is_recognised_below_many_empty_rows(tmp_path, separator):
    heights = np.full((43, 2000), np.nan)
    heights[-3:] = np.random.default_rng(0).normal(size=(3, 2000)).round(4)
    text = rows(heights, separator).replace("nan", "")
    surface = load_surface(put(tmp_path / "m.txt", text), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * heights, rtol=1e-15)


@pytest.mark.parametrize("end", ["\t", "\t\n", " \t\n", "\t\n\t\n"])
def test_one_tab_at_the_end_is_no_row(tmp_path, end):
    surface = load_surface(put(tmp_path / "m.txt", rows(separator="\t") + end), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)


@pytest.mark.parametrize("separator", [" ", ","])
def test_tabs_beside_rows_and_on_empty_lines_are_no_fields(tmp_path, separator):
    text = "\t# c\n\t\n" + rows(separator=separator).replace("\n", "\t\n") + " \t\n"
    surface = load_surface(put(tmp_path / "m.txt", text), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("step", [0.5, -0.25])
def test_positions_beside_the_heights_are_no_heights(tmp_path, turned, step):
    """A column of y or a row of x alone; of a plane every column is as even, and is read."""
    heights = np.random.default_rng(1).normal(size=(9, 9))
    ramp = step * np.arange(9.0)
    labelled = np.column_stack([ramp, heights])
    text = rows(labelled.T if turned else labelled)
    with pytest.raises(UnreadableFileError, match="looks like positions, not heights"):
        load_surface(put(tmp_path / "m.txt", text), **CALIBRATION)
    plane = np.add.outer(ramp, [0.5, 7.0, 3.0, 1.0])
    surface = load_surface(
        put(tmp_path / "m.txt", rows(plane.T if turned else plane)), **CALIBRATION
    )
    assert surface.shape == (plane.T if turned else plane).shape


def test_text_without_an_end_is_noted(tmp_path):
    surface = load_surface(put(tmp_path / "m.txt", rows().rstrip("\n")), **CALIBRATION)
    assert any("truncated" in note for note in surface.origin.notes)
    assert not any(isinstance(note, Statement) for note in surface.origin.notes)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1 2 3 4\n5 Bad 7 8\n9 9 9 9\n", "line 2, column 2: 'Bad'"),
        ("# c\n1,2,3,4\n5,6,7,8\n5,6,7,#\n", "line 4, column 4: '#'"),
        ("1 2 3 4\n5 6 7\n", "line 2 has 3 numbers; expected 4"),
        ("\t\t\n1\t2\t3\t4\n5\t6\t7\t8\n", "line 1 has 3 numbers; expected 4 as in line 2"),
        ("\n# c\n\n;;;\n1;2;3;4\n5;Bad;7;8\n", "line 6, column 2: 'Bad'"),
        ("\n\t\n1,2,3,4\n5,6,Bad,8\n", "line 4, column 3: 'Bad'"),
        (";;;\n" * 4, "no numbers"),
        ("1.5;2,5;3;4\n1;2;3;4\n", "points and commas"),
        ("1,05,2,07,3,01\n" * 3, "one number or two"),
        ("-4,4, 9,3, -1,2, 5,1\n" * 4, "4,4, 9,3 may be two numbers or four"),
        ("-4,4, 9,3, \n7,2 ,-1,8, \n" * 2, "4,4, 9,3 may be two numbers or four"),
        ("4,4e+00, 9,3e-01, 8\n7, nan, -1,8\n1,5, , 2\n", "4,4, 9,3 may be two"),
        ("129, 2.004, 558\n1.197, -1.414, 138\n-312, 1.614, 509\n", "1.234 may be 1.234 or 1234"),
        ("129,2.004,558\n1.197,-1.414,138\n-312,1.614,509\n", "1.234 may be 1.234 or 1234"),
        ("1,234;999;12,345;-7\n" * 2 + "998;1,002;-3,001;2,000\n", "1,234 may be 1.234 or 1234"),
        ("1.234;999;12.345;-7\n" * 2 + "998;1.002;-3.001;2.000\n", "1.234 may be 1.234 or 1234"),
        ("1.234\t9\t12.345\n" * 3 + "8\t7\t2.345\n", "1.234 may be 1.234 or 1234"),
        ("1,234,567;2,5;3;4\n" * 4, "several commas stand inside a number"),
        ("1,2,3,4;5,6,7,8\n" * 4, "several commas stand inside a number"),
        ('"1,5","2,5","3,5","4,5"\n' * 4, "column 1: '\"1'"),
        ("1,5;n.a.;3;4\n" * 4, "line 1, column 2: 'n.a.'"),
        ("1,5,2 2,5,7 3,1 4\n" * 3, "commas and blanks"),
        ("height,of,my,map\n1,2,3,4\n", "line 1, column 1: 'height'"),
        ("Part 12\nof 3.5, 2 mm\n1,2,3,4\n", "line 1, column 1: 'Part 12'.*put # before"),
        ("# c\n\nx step: 1 um\n1,2,3,4\n5,6,7,8\n", "line 3, column 1: 'x step: 1 um'"),
        ("N/A,2.5,3,4\n1,2,3,4\n", "line 1, column 1: 'N/A'; expected a number"),
        ("1 2\n3 4\n".encode("utf-16-le"), "UTF-16 without its mark"),
        ("", "zero bytes"),
        ("# nothing\n", "no numbers"),
        ("0 1 2 3 4\n" + "5 6.5 7 9 8\n" * 4, "labels"),
        (",0,1,2,3\n0,5,6,9,8\n1,5,6,7,8\n2,5,6,3,8\n", "labels"),
        ("0 .1 .2 .3 .4\n" + "".join(f"{0.5 * i} 5 9 2 8\n" for i in range(1, 6)), "labels"),
        ("1 2 3 4 5\n" * 400, "a list, not a map"),
        ("1 2 3 4\n5 6 7 8\x00\n", "zero byte at offset 15"),
    ],
)
def test_odd_matrix_is_refused(tmp_path, text, words):
    path = put(tmp_path / "odd.csv", text)
    with pytest.raises(UnreadableFileError, match=words) as caught:
        load_surface(path, **CALIBRATION)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("order", ["utf-16-le", "utf-16-be"])
def test_utf16_with_its_mark_is_read(tmp_path, order):
    (tmp_path / "t.csv").write_bytes(("\ufeff" + rows()).encode(order))
    surface = load_surface(tmp_path / "t.csv", unit="um", pixel_size=(1, 1), lateral_unit="um")
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-12)


def test_infinity_is_refused(tmp_path):
    text = rows().replace("\n", "\n", 1) + "inf " * 8 + "\n"
    with pytest.raises(UnusableSurfaceError, match="infinite"):
        load_surface(put(tmp_path / "m.txt", text), **CALIBRATION)


def test_tilted_plane_is_no_label(tmp_path):
    plane = np.add.outer(0.25 * np.arange(6.0), 0.5 * np.arange(8.0))
    surface = load_surface(put(tmp_path / "m.txt", rows(plane + 0.125)), **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, 1e-6 * (plane + 0.125))


# --- Gwyddion ASCII ---

SIZED = "h=6 w=8\npixel size=5e-007 m\ndata unit=rad\nheight conversion factor (-> m)=2e-008\n"


def test_hidden_scale_factor_is_applied(tmp_path):
    surface = load_surface(put(tmp_path / "g.txt", SIZED + rows()))
    np.testing.assert_allclose(surface.height_m[::-1], 2e-8 * MAP, rtol=1e-15)
    assert surface.pixel_size_m == (5e-7, 5e-7)
    assert surface.origin.file_format == "gwyddion"


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_header_is_known_in_other_encodings(tmp_path, encoding):
    """In UTF-16 it was an unknown format, or a bare matrix without units."""
    commented = "# Channel: z\n# Width: 4 µm\n# Height: 3 µm\n# Value units: nm\n"
    for head, unit_m in ((SIZED, 2e-8), (commented, 1e-9)):
        surface = load_surface(put(tmp_path / "g.txt", (head + rows()).encode(encoding)))
        np.testing.assert_allclose(surface.height_m[::-1], unit_m * MAP, rtol=1e-15)
        np.testing.assert_allclose(surface.pixel_size_m, (5e-7, 5e-7), rtol=1e-12)
        assert surface.origin.file_format == "gwyddion"


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_commented_header_gives_the_field(tmp_path, encoding):
    head = "# Channel: z\n# Width: 8 µm\n# Height: 12 µm\n# Value units: nm\n"
    surface = load_surface(put(tmp_path / "g.txt", (head + rows()).encode(encoding)))
    np.testing.assert_allclose(surface.height_m[::-1], 1e-9 * MAP, rtol=1e-15)
    np.testing.assert_allclose(surface.pixel_size_m, (2e-6, 1e-6), rtol=1e-15)


def test_a_commented_header_may_name_two_units(tmp_path):
    head = "# Channel: z\n# Width: 8 µm\n# Height: 12000 nm\n# Value units: m\n"
    surface = load_surface(put(tmp_path / "g.txt", head + rows()))
    np.testing.assert_allclose(surface.pixel_size_m, (2e-6, 1e-6), rtol=1e-15)
    with pytest.raises(UncalibratedError, match="'parsec'"):
        load_surface(put(tmp_path / "g.txt", head.replace("nm", "parsec") + rows()))


@pytest.mark.parametrize(
    ("old", "new", "error", "words"),
    [
        ("h=6", "h=7", UnreadableFileError, "6 rows of 8 numbers; expected 7 rows"),
        ("h=6 w=8", "h=999999 w=999999", UnreadableFileError, "999999 x 999999 points"),
        ("=2e-008", "=two", UnreadableFileError, "positive number"),
        ("=2e-008", "=-2e-008", UnreadableFileError, "positive number"),
        ("(-> m)", "(-> rad)", UncalibratedError, "'rad'"),
        ("height conversion", "another", UncalibratedError, "'rad'"),
        ("pixel size=5e-007 m\n", "", UnreadableFileError, "pixel size"),
    ],
)
def test_odd_gwyddion_header_is_refused(tmp_path, old, new, error, words):
    with pytest.raises(error, match=words):
        load_surface(put(tmp_path / "g.txt", SIZED.replace(old, new) + rows()))


# --- XYZ ---


@settings(max_examples=60, deadline=None)
@given(
    shape=st.tuples(st.integers(5, 30), st.integers(5, 30)),
    step=st.tuples(st.floats(1e-4, 1e3), st.floats(1e-4, 1e3)),
    start=st.floats(-1e4, 1e4),
    holes=st.floats(0.0, 0.4),
    seed=st.integers(0, 99),
)
def test_grid_is_found_in_any_order_with_holes(shape, step, start, holes, seed):
    rng = np.random.default_rng(seed)
    heights = rng.normal(size=shape)
    points = points_of(heights, *step) + np.array([start, -start, 0.0])
    kept = rng.random(heights.size) >= holes
    kept.reshape(shape)[[0, -1]] = kept.reshape(shape)[:, [0, -1]] = True
    grid = grid_points(rng.permutation(points[kept]), "points")
    np.testing.assert_allclose(grid.pixel_size, step, rtol=1e-6)
    np.testing.assert_array_equal(grid.height, np.where(kept.reshape(shape), heights, np.nan))
    assert grid.notes == ()


@pytest.mark.parametrize("jitter", [0.05, 0.2])
def test_jittered_points_go_to_their_nodes_with_a_note(jitter):
    rng = np.random.default_rng(1)
    heights = rng.normal(size=(40, 50))
    points = points_of(heights)
    points[:, :2] += rng.uniform(-jitter, jitter, (len(points), 2)) * [1.0, 2.0]
    grid = grid_points(rng.permutation(points), "points")
    np.testing.assert_array_equal(grid.height, heights)
    np.testing.assert_allclose(grid.pixel_size, (2.0, 1.0), rtol=1e-3)
    assert f"up to {100 * jitter:.0f} % of a pixel" in grid.notes[0]
    assert not isinstance(grid.notes[0], Statement)


def test_cloud_keeps_a_plane_and_says_what_was_done():
    rng = np.random.default_rng(2)
    xy = rng.uniform(0.0, 10.0, (20_000, 2))
    grid = grid_points(np.column_stack([xy, xy @ [0.3, -0.2]]), "points")
    dy, dx = grid.pixel_size
    assert dy == dx == pytest.approx(np.sqrt(4 * 100 / 20_000), rel=1e-3)
    i, j = np.indices(grid.height.shape)
    plane = 0.3 * (j + 0.5) * dx - 0.2 * (i + 0.5) * dy
    inside = ~np.isnan(grid.height[:-1, :-1])
    # the mean of the points of a cell lies at most half a cell from its centre
    assert np.abs((grid.height - plane)[:-1, :-1][inside]).max() < 0.25 * dx + 1e-3
    empty = np.isnan(grid.height).mean()
    assert empty == pytest.approx(np.exp(-4.0), abs=0.01)
    assert "20000 points" in grid.notes[0]
    assert not isinstance(grid.notes[0], Statement)
    assert f"{100 * empty:.1f} % of the cells are empty" in grid.notes[0]


def test_cells_of_a_cloud_are_chosen_with_the_pixel_size(tmp_path):
    rng = np.random.default_rng(2)
    cloud = np.column_stack([rng.uniform(0.0, 10.0, (500, 2)), rng.normal(size=500)])
    np.savetxt(tmp_path / "c.xyz", cloud, header="x [mm] y [mm] z [um]")
    surface = load_surface(tmp_path / "c.xyz", pixel_size=(2000.0, 1000.0), lateral_unit="um")
    np.testing.assert_allclose(surface.pixel_size_m, (2e-3, 1e-3), rtol=1e-15)
    assert surface.shape == (5, 10)
    wide = rng.permutation(np.vstack([cloud, [[1e4, 1e4, 0.0]]]))
    with pytest.raises(UnreadableFileError, match="stray points"):
        grid_points(wide, "points")
    with pytest.raises(UnreadableFileError, match="501 points in 10000 x 10000 cells"):
        grid_points(wide, "points", (1.0, 1.0))
    with pytest.raises(UnreadableFileError, match=r"2 x 3 cells of 500 x 400; .* smaller --pixel"):
        grid_points(np.random.default_rng(2).uniform(0, 1000, (400, 3)), "points", (500, 400))


def test_repeated_points_are_merged_and_contradictions_refused():
    points = points_of()
    grid = grid_points(np.vstack([points, points[5:8]]), "points")
    np.testing.assert_array_equal(grid.height, MAP)
    assert grid.notes == ("3 points that repeat another one were merged with it",)
    assert isinstance(grid.notes[0], Statement)
    other = points[9] + [0.0, 0.0, 1.0]
    with pytest.raises(
        UnreadableFileError, match=r"two heights at x = 1, y = 2: .* and "
    ) as caught:
        grid_points(np.vstack([points, other]), "points")
    assert f"{points[9, 2]:.9g}" in str(caught.value)
    assert f"{other[2]:.9g}" in str(caught.value)


def test_xyz_file_has_its_rows_along_y(tmp_path):
    text = rows(points_of(), ",")
    surface = load_surface(put(tmp_path / "p.csv", text), **LENGTHS)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)
    np.testing.assert_allclose(surface.pixel_size_m, (2e-3, 1e-3), rtol=1e-12)
    assert surface.origin.file_format == "xyz"


def test_units_in_the_line_of_names_count(tmp_path):
    path = put(tmp_path / "p.xyz", "x [mm]; y [mm]; z (nm)\n" + rows(points_of(), ";"))
    surface = load_surface(path)
    np.testing.assert_allclose(surface.height_m, 1e-9 * MAP, rtol=1e-15)
    with pytest.raises(UncalibratedError, match="never overridden"):
        load_surface(path, unit="um")
    with pytest.raises(UncalibratedError, match="--lateral-unit"):
        load_surface(put(tmp_path / "q.xyz", rows(points_of())), unit="um")


@pytest.mark.parametrize(
    "between", ["", "\n", "# -----\n", "# [um] [mm] [um]\n", "# z over y and x\n\n# 2026-01-01\n"]
)
@pytest.mark.parametrize("sign", ["", "# "])
@pytest.mark.parametrize(
    ("names", "extension"),
    [("y,x,z", "csv"), ("z,X,y", "xyz"), ("i,x,y,z", "csv"), ("y,z,i,x", "xyz")],
)
def test_names_hold_whatever_stands_between_them_and_the_numbers(
    tmp_path, between, sign, names, extension
):
    x, y, z = points_of().T
    columns = {"i": np.arange(MAP.size), "x": x, "y": y, "z": z}
    points = np.column_stack([columns[name] for name in names.lower().split(",")])
    text = f"{sign}{names}\n{between}{rows(points, ',')}"
    surface = load_surface(put(tmp_path / f"p.{extension}", text), **LENGTHS)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)
    np.testing.assert_allclose(surface.pixel_size_m, (2e-3, 1e-3), rtol=1e-12)


def test_two_lines_of_names_have_one_order(tmp_path):
    body = rows(points_of()[:, [1, 0, 2]])
    surface = load_surface(
        put(tmp_path / "p.xyz", "# y x z\n# y [mm] x [mm] z\n" + body), unit="um"
    )
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)
    with pytest.raises(
        UnreadableFileError, match="columns 3, 1, 2 by one line of names and 2, 1, 3 by another"
    ):
        load_surface(put(tmp_path / "p.xyz", "# y z x\n# y x z\n# c\n" + body), **LENGTHS)


@pytest.mark.parametrize(
    ("line", "order"),
    [
        ("y_um,x_um,z_um", "yxz"),
        ("Y/um,X/um,Z/um", "yxz"),
        ("y / um, x / um, z / um", "yxz"),
        ("Y,X,Height", "yxz"),
        ("Heights,X,Y", "zxy"),
        ("y (slow axis),x (fast axis),z", "yxz"),
        ("Elevation [um] X [um] Y [um]", "zxy"),
        ("# columns: Y X Z", "yxz"),
        ("# columns of points: Z, X, Y", "zxy"),
        ("y X z extra", "yxz"),
        ("y,height,x,z", "yixz"),
        ("Z_um,Y_um,Height_um,X_um", "zyix"),
        ("z,x,noise:,y", "zxiy"),
    ],
)
@pytest.mark.parametrize("extension", ["csv", "xyz"])
def test_names_of_columns_are_understood_as_people_write_them(tmp_path, line, order, extension):
    x, y, z = points_of().T
    columns = {"i": np.arange(MAP.size), "x": x, "y": y, "z": z}
    body = rows(np.column_stack([columns[name] for name in order]), ",")
    surface = load_surface(
        put(tmp_path / f"p.{extension}", f"{line}\n{body}"), unit="um", lateral_unit="um"
    )
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)
    np.testing.assert_allclose(surface.pixel_size_m, (2e-6, 1e-6), rtol=1e-12)
    assert not any("not understood" in note for note in surface.origin.notes)


@pytest.mark.parametrize(
    "line",
    ["x_mm,y_mm,z_nm", "X/mm,Y/mm,Z/nm", "x [mm] y [mm] height (nm)", "x_mm y_mm height_nm i"],
)
def test_units_behind_names_hold_against_what_is_given(tmp_path, line):
    path = put(tmp_path / "p.csv", f"{line}\n{rows(points_of(), ',')}")
    surface = load_surface(path)
    np.testing.assert_allclose(surface.height_m, 1e-9 * MAP, rtol=1e-15)
    np.testing.assert_allclose(surface.pixel_size_m, (2e-3, 1e-3), rtol=1e-12)
    with pytest.raises(UncalibratedError, match="stored in mm, but --lateral-unit says um"):
        load_surface(path, lateral_unit="um")
    with pytest.raises(UncalibratedError, match="stored in nm, but --unit says um"):
        load_surface(path, unit="um")


def test_a_height_that_stands_alone_is_no_unit_of_z(tmp_path):
    path = put(tmp_path / "p.csv", "# Height [mm]: 12\nx [mm],y,z\n" + rows(points_of(), ","))
    with pytest.raises(UnreadableFileError, match="x in mm, y in None"):
        load_surface(path)
    path = put(tmp_path / "p.csv", "# Height [mm], of x\nx,y,z\n" + rows(points_of(), ","))
    with pytest.raises(UncalibratedError, match="the file says neither the unit"):
        load_surface(path)


@pytest.mark.parametrize(
    "line",
    [
        "# measured by y. smith at x 20",
        "# stage at Z 40 Y 30 X 20",
        "# Z Y X 40 30 20",
        "# Z 40 Y 30 X 20",
        "# y is up, x to the right",
        "# x and y in mm, z in um",
        "# height as a function of y and x",
        "# heights over x and y",
        "# y",
        "X Position,Y Position,Z Position",
    ],
)
def test_a_remark_is_no_line_of_names(tmp_path, line):
    path = put(tmp_path / "p.csv", f"{line}\n{rows(points_of(), ',')}")
    surface = load_surface(path, **LENGTHS)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)
    assert surface.origin.notes == ()


@pytest.mark.parametrize("line", ["y x z", "# x, y and z, and two more columns"])
def test_fewer_names_than_columns_are_asked_for(tmp_path, line):
    """Row numbers without a name may come first, as other programs write them."""
    points = np.column_stack([np.arange(MAP.size), points_of(), MAP.ravel()])
    path = put(tmp_path / "p.csv", f"{line}\n{rows(points, ',')}")
    with pytest.raises(UnreadableFileError, match=r"5 columns; .* or a line with their names"):
        load_surface(path, **LENGTHS)


@pytest.mark.parametrize("word", ["a", "x(", "x_", "x / "])
def test_a_long_remark_is_passed_over_quickly(tmp_path, word):
    path = put(tmp_path / "p.csv", f"# {word * (60_000 // len(word))}\n{rows(points_of(), ',')}")
    started = time.process_time()
    np.testing.assert_allclose(load_surface(path, **LENGTHS).height_m, 1e-6 * MAP, rtol=1e-15)
    assert time.process_time() - started < 2.0


@pytest.mark.parametrize(
    "line",
    [
        "Y,X,Depth",
        "Depth,X,Y",
        "Y_MM,X_MM,Z_UM",
        "Y Position,X Position,Z Position",
        "# Columns Y X Z",
        "# y z x y",
    ],
)
def test_names_in_another_order_that_are_not_understood_are_said(tmp_path, line):
    path = put(tmp_path / "p.csv", f"{line}\n{rows(points_of(), ',')}")
    (note,) = load_surface(path, **LENGTHS).origin.notes
    assert note == (
        f"{line.lstrip('# ')!r} was not understood as names of columns: columns 1, 2, 3 were "
        "taken for x, y, z"
    )
    assert not isinstance(note, Statement)
    understood = put(tmp_path / "q.csv", f"# {line}\nx y z\n{rows(points_of(), ',')}")
    assert load_surface(understood, **LENGTHS).origin.notes == ()


@pytest.mark.parametrize("separator", ["\t", ","])
def test_an_empty_row_is_no_point(tmp_path, separator):
    empty = 2 * separator + "\n"
    points = points_of(np.where(MAP[2, 3] == MAP, np.nan, MAP))
    text = f"{empty}x{separator}y{separator}z\n{empty}{rows(points, separator)}{empty}{empty}"
    surface = load_surface(put(tmp_path / "p.csv", text), **LENGTHS)
    np.testing.assert_allclose(surface.height_m.ravel(), 1e-6 * points[:, 2], rtol=1e-15)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p: p[:5], "at least 9"),
        (lambda p: np.where(p == p[3], np.nan, p), r"point 1 is \(nan|point \d+ is"),
        (lambda p: np.where(p == p[3, 2], np.inf, p), "point 4 is .*inf"),
        (lambda p: p * [0.0, 1.0, 1.0], "all points have x = 0"),
        (lambda p: p[:, :2], "2 columns"),
    ],
)
def test_odd_points_are_refused(tmp_path, change, words):
    np.savetxt(tmp_path / "p.xyz", change(points_of()))
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(tmp_path / "p.xyz", **LENGTHS)


@pytest.mark.parametrize("line", [1, 4])
def test_word_among_points_is_named(tmp_path, line):
    lines = rows(points_of()).split("\n")
    lines[line - 1] = "1.0 Bad 2.0"
    with pytest.raises(UnreadableFileError, match=f"line {line}, column 2: 'Bad'"):
        load_surface(put(tmp_path / "p.xyz", "\n".join(lines)), **LENGTHS)


@pytest.mark.long
def test_million_points_are_read_in_time_and_memory(tmp_path):
    rng = np.random.default_rng(4)
    points = points_of(rng.normal(size=(1000, 1000)), 0.0101, 0.0123)
    path = tmp_path / "million.xyz"
    with path.open("w") as file:
        file.writelines(f"{x:.4f} {y:.4f} {z:.6f}\n" for x, y, z in rng.permutation(points))
    code = (
        "import sys, time; from capslip.surface.readers import load_surface\n"
        "start = time.process_time()\n"
        "surface = load_surface(sys.argv[1], unit='um', lateral_unit='mm')\n"
        "read = time.process_time()\n"
        "status = open('/proc/self/status').read() if sys.platform == 'linux' else 'VmHWM: 0 kB'\n"
        "begin = time.process_time()\n"
        "[float(word) for word in open(sys.argv[1]).read().split()]\n"  # the least work there is
        "by_hand = (read - start) / (time.process_time() - begin)\n"
        "print(surface.shape, by_hand, status.split('VmHWM:')[1].split()[0])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, path], capture_output=True, text=True, check=True
    )
    shape, _, rest = done.stdout.partition(") ")
    by_hand, peak_kB = map(float, rest.split())
    assert shape == "(1000, 1000"
    assert by_hand < 3.0
    assert peak_kB < 400_000


# --- SDF in text ---

FIELDS = (
    "ManufacID = test\nNumPoints = 8\nNumProfiles = 6\nXscale = 1E-6\nYscale = 2E-6\n"
    "Zscale = 1E-9\nZresolution = 1E-9\nCompression = 0\nDataType = 7\nCheckType = 0\n"
)


@pytest.mark.parametrize("magic", ["aISO-1.0", "aBCR-1.0", "aISO-2.0"])
@pytest.mark.parametrize("separator", [" ", "\n"])
def test_sdf_text(tmp_path, magic, separator, monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    body = rows(separator=separator).replace(f"{MAP[2, 3]:.4f}", "BAD")
    surface = load_surface(put(tmp_path / "s.sdf", f"{magic}\r\n{FIELDS}*\n{body}*\n*\n"))
    expected = np.where(MAP[2, 3] == MAP, np.nan, 1e-9 * MAP)
    np.testing.assert_allclose(surface.height_m, expected, rtol=1e-15)
    assert surface.pixel_size_m == (2e-6, 1e-6)
    assert surface.origin.notes == ()


@pytest.mark.parametrize(
    ("code", "bad", "least"),
    [
        (0, None, "255"),
        (1, "65535", "65534"),
        (2, "4294967295", "4294967294"),
        (3, "-3.402823e+38", "-3.402e+38"),
        (3, "-3.4028234663852886e+38", "65535"),
        (4, "-128", "-127"),
        (5, "-32768", "-32767"),
        (6, "-2147483648", "-2147483647"),
        (7, "-1.79769e+308", "-3.402823e+38"),
        (7, "-1.7976931348623157e+308", "-32768"),
    ],
)
def test_the_marker_of_its_type_is_non_measured_in_sdf_text_too(tmp_path, code, bad, least):
    """And nothing else is: not the number beside it, nor the marker of another type."""
    body = "1 2 3 4 5 6 7 8\n" * 4 + f"1 2 {bad or 9} 4 5 6 7 BAD\n{least} 2 3 4 5 6 7 8\n"
    head = FIELDS.replace("DataType = 7", f"DataType = {code}")
    surface = load_surface(put(tmp_path / "s.sdf", f"aISO-1.0\n{head}*\n{body}*\n"))
    lost = ([[4, 2]] if bad else []) + [[4, 7]]
    assert np.argwhere(~surface.measured).tolist() == lost
    assert surface.height_m[5, 0] == float(least) * 1e-9


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("NumPoints = 8", "NumPoints = 9", "48 heights; expected 54"),
        ("NumPoints = 8", "NumPoints = 1000000000000", "1000000000000 points"),
        ("NumPoints = 8", "NumPoints = 0", "NumPoints is 0"),
        ("NumPoints = 8", "NumPoints = many", "NumPoints is 'many'"),
        ("Zscale = 1E-9\n", "", "Zscale is 'missing'"),
        ("Zscale = 1E-9", "Zscale = -1", "Zscale is -1"),
        ("Compression = 0", "Compression = 1", "Compression is 1"),
        ("DataType = 7", "DataType = 8", "DataType is 8"),
        (f"{MAP[0, 2]:.4f}", "Bed", "height 3 of 48 is 'Bed'"),
        ("*\n", "", "asterisk"),
        ("aISO-1.0", "aISO-9.0", "version aISO-9.0"),
    ],
)
def test_odd_sdf_text_is_refused(tmp_path, old, new, words):
    text = f"aISO-1.0\n{FIELDS}*\n{rows()}*\n*\n".replace(old, new)
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(put(tmp_path / "s.sdf", text))


@pytest.mark.long
def test_refusing_is_quick(tmp_path):
    """In the median of three: one of them alone may be any number on a machine that is shared."""
    text = "1 2 3\n" * 1_000_000 + "1 2 Bad\n"
    path, ratios = put(tmp_path / "p.xyz", text), []
    for _ in range(3):
        at_s = [time.process_time()]
        assert len([float(word) for word in text.split()[:-1]]) == 3_000_002  # the least work
        at_s.append(time.process_time())
        with pytest.raises(UnreadableFileError, match="line 1000001, column 3: 'Bad'"):
            load_surface(path, **LENGTHS)
        by_hand_s, refused_s = np.diff([*at_s, time.process_time()])
        ratios.append(refused_s / by_hand_s)
    assert np.median(ratios) < 3.0


@pytest.mark.parametrize("line", ["1.5,", ",", "1", "a,"])
def test_a_line_without_end_is_refused_before_memory_is_taken(tmp_path, line):
    path = put(tmp_path / "a.csv", "1,2,3\n" + line * (10_000_000 // len(line)) + "\n")
    tracemalloc.start()
    with pytest.raises(UnreadableFileError, match=r"line [12] has \d+ bytes; expected at most"):
        load_surface(path, unit="um", pixel_size=(1, 1), lateral_unit="um")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 * 10_000_000


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        ("0 1 2 5\n1 2 3 5\n2 3 5 5\n", "--unit UNIT --pixel-size DY DX --lateral-unit UNIT"),
        (
            "".join(f"{i % 3} {i // 3} {i * i}\n" for i in range(9)),
            "--unit UNIT --lateral-unit UNIT",
        ),
    ],
)
def test_one_message_asks_for_all_that_a_file_does_not_say(text, asked, tmp_path):
    (tmp_path / "a.csv").write_text(text, "utf-8")
    with pytest.raises(UncalibratedError, match=asked):
        load_surface(tmp_path / "a.csv")
