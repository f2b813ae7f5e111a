"""HDF5: nothing outside the file, no endless look, and the numbers that the attributes mean."""

import mmap
import time

import h5py
import numpy as np
import pytest

from capslip.errors import UncalibratedError, UnreadableFileError
from capslip.surface.heightmap import HeightMap, Statement
from capslip.surface.readers import hdf5, load_surface

MAP = np.random.default_rng(4).normal(size=(6, 8))
GIVEN = {"unit": "um", "pixel_size": (2.0, 1.0), "lateral_unit": "um"}
HEAD_7_3 = b"MATLAB 7.3 MAT-file".ljust(512)


@pytest.fixture
def elsewhere(tmp_path):
    """Another file, which nobody asked to read."""
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["height"] = MAP
    MAP.tofile(tmp_path / "raw.bin")
    return tmp_path


def external_link(file, folder):
    file["height"] = h5py.ExternalLink(str(folder / "other.h5"), "/height")


def linked_group(file, folder):
    file["far"] = h5py.ExternalLink(str(folder / "other.h5"), "/")
    file["height"] = h5py.SoftLink("/far/height")


def external_storage(file, folder):
    storage = [(str(folder / "raw.bin"), 0, MAP.nbytes)]
    file.create_dataset("height", MAP.shape, "f8", external=storage)


def virtual(file, folder):
    layout = h5py.VirtualLayout(MAP.shape, "f8")
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "height", MAP.shape)
    file.create_virtual_dataset("height", layout)


@pytest.mark.parametrize("is_mat", [False, True])
@pytest.mark.parametrize(
    ("write", "words"),
    [
        (external_link, "link to another file"),
        (linked_group, "link to another file"),
        (external_storage, "in another file"),
        (virtual, "virtual"),
    ],
)
def test_numbers_of_other_files_are_refused(elsewhere, write, words, is_mat):
    path = elsewhere / "face.h5"
    with h5py.File(path, "w", userblock_size=512 if is_mat else 0) as file:
        write(file, elsewhere)
    if is_mat:
        with path.open("r+b") as file:
            file.write(HEAD_7_3)
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(path, dataset="height", **GIVEN)


@pytest.mark.parametrize("write", [external_link, linked_group, external_storage, virtual])
@pytest.mark.parametrize("name", ["face.datx", "face.nc"])
def test_makers_formats_inside_hdf5_stay_inside_too(elsewhere, write, name):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    with h5py.File(elsewhere / name, "w") as file:
        write(file, elsewhere)
    with pytest.raises(UnreadableFileError, match=r"another file|virtual"):
        load_surface(elsewhere / name)


@pytest.mark.parametrize("word", ["unit", "units"])
def test_a_dataset_in_volts_is_no_map_of_heights(tmp_path, word):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["height"] = MAP
        file["height"].attrs[word] = "V"
    with pytest.raises(UncalibratedError, match="the file says 'V'; expected a unit of length"):
        load_surface(tmp_path / "a.h5", pixel_size=(1, 1), lateral_unit="um")


def test_links_inside_the_file_are_followed(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["scan/z"] = MAP
        file["scan/first"] = h5py.SoftLink("z")
        file["height"] = h5py.SoftLink("/scan/first")
    surface = load_surface(tmp_path / "a.h5", **GIVEN)
    np.testing.assert_allclose(surface.height_m, 1e-6 * MAP, rtol=1e-15)


def test_links_in_a_circle_end(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["height"] = h5py.SoftLink("/other")
        file["other"] = h5py.SoftLink("/height")
    with pytest.raises(UnreadableFileError, match="more than 64 groups and links"):
        load_surface(tmp_path / "a.h5", **GIVEN)


@pytest.mark.parametrize("shape", ["deep", "wide"])
def test_the_list_of_datasets_ends(tmp_path, shape):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file
        for number in range(3000):
            made = group.create_group(f"g{number}")
            group = made if shape == "deep" else file
        file["z"] = MAP
    started = time.process_time()
    with pytest.raises(UnreadableFileError, match=r"no dataset 'height'.*--dataset"):
        load_surface(tmp_path / "a.h5", **GIVEN)
    assert time.process_time() - started < 1.0


def test_counts_are_scaled_as_the_attributes_say(tmp_path):
    counts = np.round(100 * MAP).astype("i2")
    counts[2, 3:5] = -32768
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["height"] = counts
        attributes = {"scale_factor": 0.01, "add_offset": 7.0, "_FillValue": np.int16(-32768)}
        file["height"].attrs.update(attributes)
    surface = load_surface(tmp_path / "a.h5", **GIVEN)
    expected = 1e-6 * (0.01 * counts + 7.0)
    expected[2, 3:5] = np.nan
    np.testing.assert_allclose(surface.height_m, expected, rtol=1e-12)
    assert "2 points with the _FillValue -32768 are non-measured" in surface.origin.notes
    assert any("0.01 times the stored numbers plus 7" in note for note in surface.origin.notes)
    assert all(isinstance(note, Statement) for note in surface.origin.notes)


@pytest.mark.parametrize("name", ["_FillValue", "missing_value"])
@pytest.mark.parametrize("code", [-9999.0, np.nan])
def test_a_value_that_no_point_has_is_not_said(tmp_path, name, code):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["height"] = MAP
        file["height"].attrs[name] = code
    surface = load_surface(tmp_path / "a.h5", **GIVEN)
    np.testing.assert_array_equal(surface.height_m, 1e-6 * MAP)
    assert surface.origin.notes == ()


@pytest.mark.parametrize("name", ["scale_factor", "add_offset", "_FillValue"])
def test_odd_attributes_are_refused(tmp_path, name):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["height"] = MAP
        file["height"].attrs[name] = "two"
    with pytest.raises(UncalibratedError, match=f"{name}.*expected one number"):
        load_surface(tmp_path / "a.h5", **GIVEN)


@pytest.mark.parametrize("block", [1, 7, 64])
def test_words_are_found_wherever_blocks_end(tmp_path, monkeypatch, block):
    monkeypatch.setattr(hdf5, "BLOCK", block)
    path = tmp_path / "a"
    path.write_bytes(b"unit\0" + b"x" * 60 + b"unit\0uniunit\0")
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        assert list(hdf5._places(content, b"unit\0", [(0, len(content))])) == [0, 65, 73]


@pytest.mark.parametrize("options", [{}, {"chunks": (2, 2)}, {"chunks": (4, 4), "compression": 4}])
def test_all_but_the_heights_is_searched(tmp_path, options):
    heights = np.random.default_rng(1).normal(size=(8, 9))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("height", data=heights, **options)
    n_bytes = (tmp_path / "a.h5").stat().st_size
    with h5py.File(tmp_path / "a.h5") as file:
        height = file["height"]
        beside = hdf5._beside(height, n_bytes)
        assert sum(end - start for start, end in beside) == n_bytes - height.id.get_storage_size()
    content = bytearray((tmp_path / "a.h5").read_bytes())
    for start, end in beside:
        content[start:end] = bytes(end - start)
    assert (heights.tobytes() in bytes(content)) == (not options)


def test_the_noise_that_a_map_says_is_read_in_metres_whatever_its_units(tmp_path):
    path = tmp_path / "face.h5"
    surface = HeightMap(1e-6 * MAP, (1e-6, 1e-6), noise_m=2.5e-9, form_error_m=4e-8)
    hdf5.write_hdf5(surface, path, unit="nm")
    found = load_surface(path)
    assert (found.noise_m, found.form_error_m) == (2.5e-9, 4e-8)
    assert found.origin.notes == ()
    hdf5.write_hdf5(HeightMap(1e-6 * MAP, (1e-6, 1e-6)), path)
    found = load_surface(path)
    assert (found.noise_m, found.form_error_m) == (None, None)


@pytest.mark.parametrize(("name", "said"), [("noise_m", "noise"), ("form_error_m", "form")])
@pytest.mark.parametrize("value", [0.0, -1e-9, np.nan, np.inf, "2 nm", [1e-9, 2e-9]])
def test_a_noise_that_is_none_is_named(tmp_path, value, name, said):
    path = tmp_path / "face.h5"
    hdf5.write_hdf5(HeightMap(1e-6 * MAP, (1e-6, 1e-6)), path)
    with h5py.File(path, "a") as file:
        file["height"].attrs[name] = value
    with pytest.raises((UncalibratedError, UnreadableFileError), match=said):
        load_surface(path)
