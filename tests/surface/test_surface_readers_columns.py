"""Names of the columns of a table: rows and columns, lengths and counts, what contradicts."""

import numpy as np
import pytest

from capslip.errors import UncalibratedError, UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers import load_surface

# No turn, mirror or transpose of it is alike
PICTURE = np.round(np.random.default_rng(11).normal(size=(5, 8)), 4)
PIXEL = {"pixel_size": (3.0, 2.0), "lateral_unit": "mm"}  # (dy, dx)
DY, DX = 3.0, 2.0


def table(path, names, columns, order="rows", first=0, steps=(1.0, 1.0)):
    """Write a table of the picture: `columns` says r, c, z, or n (a running number) of each."""
    i, j = np.indices(PICTURE.shape)
    held = {
        "r": (i + first) * steps[0],
        "c": (j + first) * steps[1],
        "z": PICTURE,
        "n": np.arange(PICTURE.size).reshape(PICTURE.shape),
    }
    how = {"rows": "C", "columns": "F", "shuffled": "C"}[order]
    values = np.column_stack([held[one].ravel(how) for one in columns])
    if order == "shuffled":
        values = np.random.default_rng(5).permutation(values)
    separator = next((one for one in ",;\t" if one in names), " ")
    lines = [separator.join(f"{value:g}" for value in row) for row in values]
    path.write_text("\n".join([names, *lines, ""]), encoding="utf-8")
    return path


def told(surface):
    return [note for note in surface.origin.notes if "taken for column, row, height" in note]


NAMES = [
    ("row,col,height", "rcz"),
    ("col,row,height", "crz"),
    ("height,row,col", "zrc"),
    ("col,height,row", "czr"),
    ("z;column;row", "zcr"),
    ("Line;Column;Z", "rcz"),
    ("columns\tlines\televation", "crz"),
    ("i,j,z", "rcz"),
    ("j,i,height", "crz"),
    ("z i j", "zrc"),
    ("# row col height", "rcz"),
    ("# columns: height row col", "zrc"),
    ("Row [px],Col [px],Height", "rcz"),
    ("row_idx,col_idx,z", "rcz"),
    ("Row Index,Column Index,Height", "rcz"),
    ("row,col,value", "rcz"),
    ("point,row,col,height", "nrcz"),
    ("i,col,row,z", "ncrz"),
]


@pytest.mark.parametrize("order", ["rows", "columns", "shuffled"])
@pytest.mark.parametrize(("names", "columns"), NAMES)
def test_rows_and_columns_are_read_by_their_names(tmp_path, names, columns, order):
    path = table(tmp_path / "t.csv", names, columns, order)
    surface = load_surface(path, unit="um", **PIXEL)
    np.testing.assert_allclose(surface.height_m, 1e-6 * PICTURE, rtol=1e-15)
    assert surface.pixel_size_m == (3e-3, 2e-3)
    (note,) = told(surface)
    assert isinstance(note, Statement)


@pytest.mark.parametrize("first", [0, 1, -3])
@pytest.mark.parametrize("extension", ["csv", "txt", "xyz"])
def test_it_does_not_matter_from_what_number_on_rows_are_counted(tmp_path, first, extension):
    path = table(tmp_path / f"t.{extension}", "row,col,height", "rcz", first=first)
    surface = load_surface(path, unit="um", **PIXEL)
    np.testing.assert_allclose(surface.height_m, 1e-6 * PICTURE, rtol=1e-15)


def test_rows_lie_as_those_of_a_matrix_that_holds_the_same(tmp_path):
    path, matrix = table(tmp_path / "t.csv", "row,col,height", "rcz"), tmp_path / "matrix.csv"
    np.savetxt(matrix, PICTURE, delimiter=",")
    for given, heights in ((None, PICTURE), (False, PICTURE), (True, PICTURE[::-1])):
        for one in (path, matrix):
            surface = load_surface(one, unit="um", **PIXEL, top_row_first=given)
            np.testing.assert_allclose(surface.height_m, 1e-6 * heights, rtol=1e-15)


@pytest.mark.parametrize("order", ["rows", "shuffled"])
@pytest.mark.parametrize(
    ("names", "columns"),
    [
        ("row_mm,col_mm,height_um", "rcz"),
        ("Col [mm];Row [mm];Height [um]", "crz"),
        ("z_um,line_mm,column_mm", "zrc"),
        ("i/mm j/mm z/um", "rcz"),
    ],
)
def test_rows_and_columns_with_a_unit_are_lengths(tmp_path, names, columns, order):
    path = table(tmp_path / "t.csv", names, columns, order, steps=(DY, DX))
    surface = load_surface(path)
    np.testing.assert_allclose(surface.height_m, 1e-6 * PICTURE, rtol=1e-15)
    np.testing.assert_allclose(surface.pixel_size_m, (3e-3, 2e-3), rtol=1e-12)
    with pytest.raises(UncalibratedError, match="lateral-unit says um"):
        load_surface(path, lateral_unit="um")
    with pytest.raises(UncalibratedError, match="pixel size in the file is never overridden"):
        load_surface(path, pixel_size=(2.0, 3.0), lateral_unit="mm")


def test_rows_in_other_steps_than_counts_are_lengths_whose_unit_is_asked_for(tmp_path):
    path = table(tmp_path / "t.csv", "row,col,height", "rcz", steps=(0.3, 0.2))
    with pytest.raises(UncalibratedError, match="but not its unit; add --lateral-unit"):
        load_surface(path, unit="um")
    surface = load_surface(path, unit="um", lateral_unit="mm")
    np.testing.assert_allclose(surface.height_m, 1e-6 * PICTURE, rtol=1e-15)
    np.testing.assert_allclose(surface.pixel_size_m, (3e-4, 2e-4), rtol=1e-9)


@pytest.mark.parametrize("given", [{}, {"lateral_unit": "mm"}])
def test_counts_are_no_lengths(tmp_path, given):
    """As of a matrix: a step of one was one millimetre where that was the unit."""
    path = table(tmp_path / "t.csv", "row,col,height_um", "rcz")
    with pytest.raises(UncalibratedError, match=r"does not say its pixel size; .* --pixel-size"):
        load_surface(path, **given)


def test_thinned_and_lost_counts_keep_their_places(tmp_path):
    path = table(tmp_path / "t.csv", "row [px],col [px],z", "rcz", steps=(5.0, 10.0))
    surface = load_surface(path, unit="um", **PIXEL)
    np.testing.assert_allclose(surface.height_m, 1e-6 * PICTURE, rtol=1e-15)
    path = table(tmp_path / "t.csv", "row,col,z", "rcz")
    names, *lines = path.read_text().splitlines()
    path.write_text("\n".join([names, *lines[:8], *lines[17::3], ""]))
    surface = load_surface(path, unit="um", **PIXEL)
    kept = np.full(PICTURE.size, np.nan)
    kept[:8], kept[17::3] = PICTURE.flat[:8], PICTURE.flat[17::3]
    np.testing.assert_allclose(surface.height_m, 1e-6 * kept.reshape(PICTURE.shape))


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        ("x,row,z", "crz"),
        ("y,col,height", "rcz"),
        ("row,row,height", "rcz"),
        ("row line height", "rcz"),
        ("col,column,z", "rcz"),
        ("x,row,col,z", "ncrz"),
        ("row,line,col,z", "nrcz"),
        ("ROW_MM,COL_MM,Z_UM", "rcz"),
        ("Row Position,Column Position,Height", "rcz"),
    ],
)
def test_names_that_contradict_each_other_are_refused_in_one_line(tmp_path, names, columns):
    path = table(tmp_path / "t.csv", names, columns)
    with pytest.raises(UnreadableFileError) as caught:
        load_surface(path, unit="um", **PIXEL)
    message = str(caught.value)
    assert message == (
        f"{path}: {names!r} names the columns; expected x, y, z, or row, column, height, each "
        "once, with its unit as in row_mm; correct the line"
    )


def test_rows_and_columns_have_one_unit(tmp_path):
    path = table(tmp_path / "t.csv", "row_px,col_mm,z", "rcz")
    with pytest.raises(UnreadableFileError, match="x in mm, y in px; expected one unit"):
        load_surface(path, unit="um", **PIXEL)


@pytest.mark.parametrize("between", ["# x y z", "# y x z", "# col row height"])
def test_two_lines_of_names_that_differ_are_refused(tmp_path, between):
    """x, y, z have their rows from below, rows and columns from the top."""
    path = table(tmp_path / "t.csv", f"{between}\nrow,col,height", "rcz")
    with pytest.raises(UnreadableFileError, match=r"by one line of names and .* by another"):
        load_surface(path, unit="um", **PIXEL)


@pytest.mark.parametrize(
    ("step", "words"), [(1.3, "not in whole steps"), (4000.0, "40 points in 16001 rows and 28001")]
)
def test_odd_counts_are_refused(tmp_path, step, words):
    path = table(tmp_path / "t.csv", "row [px],col [px],z", "rcz", steps=(step, step))
    if step > 2.0:  # one point beside the others, which the steps then count
        path.write_text(path.read_text() + "1,1,0.5\n")
        words = words.replace("40", "41", 1)
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(path, unit="um", **PIXEL)


@pytest.mark.parametrize(
    "line", ["# rows 5 cols 8 z", "# row by row, column j of heights here", "# one row a line"]
)
def test_a_remark_above_a_matrix_is_no_line_of_names(tmp_path, line):
    rows = [" ".join(f"{value:g}" for value in row) for row in PICTURE]
    path = tmp_path / "m.txt"
    path.write_text("\n".join([line, *rows, ""]))
    surface = load_surface(path, unit="um", **PIXEL)
    assert surface.origin.file_format == "text"
    np.testing.assert_allclose(surface.height_m, 1e-6 * PICTURE, rtol=1e-15)


def test_x_and_y_count_more_than_rows_and_columns_beside_them(tmp_path):
    i, j = np.indices(PICTURE.shape)
    columns = (i, DY * i, DX * j, j, PICTURE)
    values = np.column_stack([one.ravel() for one in columns])
    lines = [",".join(f"{value:g}" for value in row) for row in values]
    path = tmp_path / "t.csv"
    path.write_text("\n".join(["row,y_mm,x_mm,col,z", *lines, ""]))
    surface = load_surface(path, unit="um")
    np.testing.assert_allclose(surface.height_m, 1e-6 * PICTURE, rtol=1e-15)
    np.testing.assert_allclose(surface.pixel_size_m, (3e-3, 2e-3), rtol=1e-12)


@pytest.mark.parametrize(
    ("names", "columns", "called"),
    [
        ("row,column,Depth", "rcz", "Depth"),
        ("Depth;column;row", "zcr", "Depth"),
        ("i,j,gap", "rcz", "gap"),
        ("row,col,z_depth", "rcz", "z_depth"),
        ("x,y,depth", "crz", "depth"),
        ("X,Y,Gap", "crz", "Gap"),
        ("row,column,height", "rcz", None),
        ("x,y,z", "crz", None),
    ],
)
def test_a_column_of_depths_is_said_and_turned_by_invert(tmp_path, names, columns, called):
    """They grow into the material, and ran as heights without a word: a face of its pits."""
    path = table(tmp_path / "t.csv", names, columns)
    given = {"unit": "um", "pixel_size": (1.0, 1.0), "lateral_unit": "mm"}
    heights, turned = (load_surface(path, **given, invert=invert) for invert in (False, True))
    np.testing.assert_allclose(1e6 * heights.height_m, PICTURE)
    np.testing.assert_array_equal(turned.height_m, -heights.height_m)
    words = [note for note in heights.origin.notes if "reading.invert" in note]
    assert [note.partition(" sounds")[0] for note in words] == ([repr(called)] if called else [])
    assert not any(isinstance(note, Statement) for note in words)
    assert not any("invert" in note for note in turned.origin.notes)
