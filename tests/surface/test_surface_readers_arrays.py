"""Arrays that are lists of points, and what marks non-measured points in bare numbers."""

import gzip
import hashlib
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from capslip.errors import UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers import load_surface

JOINT = Path(__file__).parents[3] / "shared" / "joint" / "brb_surface_data.mat"
MAP = np.random.default_rng(4).normal(size=(20, 30))
LENGTHS = {"unit": "um", "lateral_unit": "um"}


def points_of(z):
    y, x = np.indices(z.shape)
    return np.column_stack([x.ravel(), 2.0 * y.ravel(), z.ravel()])


def npy(path, array):
    np.save(path, array)


def npz(path, array):
    np.savez(path, array=array)


def mat(path, array):
    savemat(path, {"array": array})


def hdf5(path, array):
    with h5py.File(path, "w") as file:
        file["height"] = array


WRITERS = {"p.npy": npy, "p.npz": npz, "p.mat": mat, "p.h5": hdf5}


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("turned", [False, True])
def test_an_array_of_points_is_no_map_of_three_columns(tmp_path, name, turned):
    points = np.random.default_rng(1).permutation(points_of(MAP))
    WRITERS[name](tmp_path / name, points.T if turned else points)
    surface = load_surface(tmp_path / name, **LENGTHS)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-12)
    np.testing.assert_allclose(surface.pixel_size_m, (2e-6, 1e-6), rtol=1e-9)
    assert "was taken for points x, y, z" in surface.origin.notes[0]
    assert isinstance(surface.origin.notes[0], Statement)


def test_a_map_of_three_long_rows_is_told_what_it_was_taken_for(tmp_path):
    np.save(tmp_path / "p.npy", np.random.default_rng(1).normal(size=(3, 160)))
    words = "array of 3 x 160 numbers was taken for points x, y, z: 160 points lie in 1 x 1 cells"
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(tmp_path / "p.npy", pixel_size=(10, 10), **LENGTHS)


@pytest.mark.parametrize("name", WRITERS)
def test_a_list_of_other_numbers_is_refused(tmp_path, name):
    WRITERS[name](tmp_path / name, np.ones((600, 4)))
    with pytest.raises(UnreadableFileError, match="600 x 4 numbers are a list, not a map"):
        load_surface(tmp_path / name, pixel_size=(1, 1), **LENGTHS)


@pytest.mark.skipif(not JOINT.is_file(), reason="no folder shared/joint beside the project")
@pytest.mark.scans
def test_the_measured_gap_of_a_lap_joint():
    given = {"unit": "m", "lateral_unit": "m", "dataset": "mesoscale_xygap"}
    gap, heights = (load_surface(JOINT, invert=invert, **given) for invert in (False, True))
    assert heights.shape == (54, 246)
    np.testing.assert_allclose(heights.pixel_size_m, (0.0264 / 53, 0.122412 / 245), rtol=1e-6)
    np.testing.assert_array_equal(gap.height_m, -heights.height_m)
    assert any("reading.invert" in note for note in gap.origin.notes)
    assert not any("reading.invert" in note for note in heights.origin.notes)


# --- marks of blanks ---

CELLS = [(1, 2), (3, 4), (9, 9)]
BARE = {**LENGTHS, "pixel_size": (2.0, 1.0)}


def with_mark(value, cells=CELLS, z=MAP):
    z = z.copy()
    z[tuple(np.transpose(cells))] = value
    return z


@pytest.mark.parametrize("value", [-9999.0, -32768.0, 1e38, -3.4028234663852886e38, 1.70141e38])
@pytest.mark.parametrize("name", [*WRITERS, "p.csv"])
def test_what_marks_blanks_is_non_measured_and_said(tmp_path, name, value):
    write = WRITERS.get(name, lambda path, z: np.savetxt(path, z, delimiter=","))
    write(tmp_path / name, with_mark(value))
    surface = load_surface(tmp_path / name, **BARE)
    assert np.argwhere(~surface.measured).tolist() == [list(cell) for cell in CELLS]
    assert surface.origin.notes[-1].startswith("3 points with ")
    assert not isinstance(surface.origin.notes[-1], Statement)


@pytest.mark.parametrize(
    ("value", "cells", "range_"),
    [
        (-9999.0, CELLS[:1], 1e5),  # once, and not far below the rest
        (-9998.0, CELLS, 1.0),  # no code
        (9999.0, CELLS, 1.0),  # high: a spike, which outliers are for
        (1e30, CELLS, 1.0),
    ],
)
def test_heights_that_only_look_odd_stay(tmp_path, value, cells, range_):
    z = range_ * (MAP - MAP.min()) / np.ptp(MAP)
    np.save(tmp_path / "a.npy", with_mark(value, cells, z))
    surface = load_surface(tmp_path / "a.npy", **BARE)
    assert surface.measured.all()
    assert surface.origin.notes == ()


def test_heights_that_are_all_absurd_are_no_marks(tmp_path):
    np.save(tmp_path / "a.npy", 1e160 * MAP)
    surface = load_surface(tmp_path / "a.npy", **BARE)
    assert surface.measured.all()
    assert surface.origin.notes == ()


# --- gzip, and names that would write to a terminal ---


@pytest.mark.parametrize("name", ["p.npy", "p.h5", "p.mat"])
def test_packed_by_gzip(tmp_path, name):
    WRITERS[name](tmp_path / name, MAP)
    content = (tmp_path / name).read_bytes()
    packed = tmp_path / f"{name}.gz"
    packed.write_bytes(gzip.compress(content, mtime=0))
    surface = load_surface(packed, **BARE)
    plain = load_surface(tmp_path / name, **BARE)
    np.testing.assert_array_equal(surface.height_m, plain.height_m)
    assert surface.origin.name == "p"
    assert surface.origin.path == str(packed)
    assert surface.origin.sha256 == hashlib.sha256(packed.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (gzip.compress(b"no scan " * 50, mtime=0)[:-6], "damaged or truncated gzip"),
        (gzip.compress(bytes(50_000_000)), "unpack to"),
        (gzip.compress(b"", mtime=0), "zero bytes"),
    ],
)
def test_odd_gzip_is_refused_and_leaves_nothing(tmp_path, content, words, monkeypatch):
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "a.npy.gz").write_bytes(content)
    with pytest.raises(UnreadableFileError, match=words) as caught:
        load_surface(tmp_path / "a.npy.gz", **BARE)
    assert str(caught.value).startswith(str(tmp_path / "a.npy.gz"))
    assert list((tmp_path / "temporary").iterdir()) == []


NASTY = "z\x1b[2J\nall is well \u202e"


@pytest.mark.parametrize("name", ["p.npz", "p.h5", "p.mat"])
def test_names_from_a_file_are_escaped_in_messages(tmp_path, name):
    path = tmp_path / name
    if name == "p.npz":
        np.savez(path, **{NASTY: MAP, "b": MAP})
    elif name == "p.h5":
        with h5py.File(path, "w") as file:
            file[NASTY] = MAP
    else:
        with h5py.File(path, "w", userblock_size=512) as file:
            file[NASTY], file["b"] = MAP, MAP
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    with pytest.raises(UnreadableFileError, match="add --dataset") as caught:
        load_surface(path, **BARE)
    assert str(caught.value).isprintable()
    assert r"z\x1b[2J\nall is well" in str(caught.value)
    surface = load_surface(path, dataset=NASTY, **BARE)
    assert surface.origin.dataset.isprintable()
