"""Faces as the settings say that they are read: two formats, and a map that was read otherwise."""

import numpy as np
import pytest
from msgspec import structs
from msgspec.structs import asdict, replace

from capslip.analysis import analyze_once
from capslip.errors import SettingsError, UncalibratedError
from capslip.settings import Reading, load_settings
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface
from capslip.surface.readers.faces import check_reading, load_faces
from capslip.surface.readers.hdf5 import write_hdf5

HEIGHT_M = np.arange(12.0).reshape(3, 4) ** 2 * 1e-8
SIZE_M = 2e-6, 1e-6
IN_UM = Reading(unit="um", lateral_unit="um", pixel_size=(2.0, 1.0))


@pytest.fixture
def text(tmp_path):
    """Return a matrix of numbers, which says neither unit nor pixel size."""
    path = tmp_path / "text.csv"
    np.savetxt(path, 1e6 * HEIGHT_M, delimiter=",", fmt="%.17g")
    return path


@pytest.fixture
def stored(tmp_path):
    """Return a file that says all of itself."""
    path = tmp_path / "stored.h5"
    write_hdf5(HeightMap(HEIGHT_M, SIZE_M), path)
    return path


def test_units_and_pixels_are_for_the_face_that_lacks_them(text, stored):
    for files in ((text, stored), (stored, text)):
        for face in load_faces(*files, IN_UM):
            np.testing.assert_allclose(face.height_m, HEIGHT_M, rtol=1e-12)
            assert face.pixel_size_m == pytest.approx(SIZE_M, rel=1e-12)


def test_units_that_no_file_lacks_are_refused(stored):
    for mate in (None, stored):
        with pytest.raises(UncalibratedError, match="leave"):
            load_faces(stored, mate, IN_UM)


def test_what_the_mate_lacks_is_asked_for_as_before(text, stored):
    with pytest.raises(UncalibratedError, match=r"text\.csv"):
        load_faces(stored, text, Reading())
    with pytest.raises(UncalibratedError, match=r"text\.csv"):
        load_faces(text, stored, Reading(unit="um"))


def test_a_sign_is_for_both(text, stored):
    for face in load_faces(text, stored, replace(IN_UM, invert=True)):
        np.testing.assert_allclose(face.height_m, -HEIGHT_M, rtol=1e-12)


@pytest.mark.parametrize("said", [{"invert": True}, {"top_row_first": True}, {"scale": 2.0}])
def test_settings_that_the_map_was_not_read_with_are_refused(text, said):
    reading = replace(IN_UM, **said)
    check_reading(load_surface(text, **asdict(reading)), reading)
    check_reading(load_surface(text, **asdict(reading)), Reading())
    (name,) = said
    for surface in (load_surface(text, **asdict(IN_UM)), HeightMap(HEIGHT_M, SIZE_M)):
        with pytest.raises(SettingsError, match=f"reading.{name} = .*load_surface"):
            check_reading(surface, reading)


OTHER = {
    "unit": {"unit": "mm"},
    "pixel_size": {"pixel_size": (7.0, 3.0)},
    "size of its unit": {"lateral_unit": "mm"},
}


@pytest.mark.parametrize("said", OTHER.values(), ids=OTHER)
def test_units_and_pixels_that_the_map_was_not_read_with_are_refused(text, stored, said):
    """They were not compared: the heights were a thousandth of what the settings said."""
    name = "unit" if "unit" in said else "pixel_size"
    reading = replace(IN_UM, **said)
    check_reading(load_surface(text, **asdict(reading)), reading)
    with pytest.raises(SettingsError, match=f"reading.{name} = .*; read it as the settings say"):
        check_reading(load_surface(text, **asdict(IN_UM)), reading)
    of_text = replace(IN_UM, lateral_unit="mm", pixel_size=tuple(1e-3 * np.array(IN_UM.pixel_size)))
    check_reading(load_surface(text, **asdict(of_text)), IN_UM)  # the same in another unit
    check_reading(load_surface(text, **asdict(replace(IN_UM, unit="µm"))), IN_UM)
    check_reading(HeightMap(HEIGHT_M, SIZE_M), reading)  # made of an array: in metres


def test_what_a_file_says_itself_is_compared_where_no_other_face_may_lack_it(stored):
    face = load_surface(stored)
    for said in ({"unit": "pm"}, {"lateral_unit": "inch"}, {"pixel_size": (9.0, 9.0)}):
        reading = Reading(**{"lateral_unit": "m", **said} if "pixel_size" in said else said)
        (name,) = said
        with pytest.raises(SettingsError, match=f"reading.{name} = "):
            check_reading(face, reading)
        check_reading(face, reading, alone=False)
    same = Reading(face.origin.height_unit, "m", tuple(face.pixel_size_m))
    check_reading(face, same)
    with pytest.raises(SettingsError, match=r"reading.unit = 'pm'"):
        analyze_once(face, load_settings(overrides=("reading.unit=pm",)))


def test_an_analysis_does_not_pretend_to_have_turned_a_map():
    surface = HeightMap(np.random.default_rng(1).normal(0.0, 1e-7, (40, 40)), SIZE_M)
    with pytest.raises(SettingsError, match="invert"):
        analyze_once(surface, load_settings(overrides=("reading.invert=true",)))


def test_nor_to_have_turned_the_other_face(text):
    """Both are read by the same settings: the first was turned, the other one was not."""
    inverted = replace(IN_UM, invert=True)
    face, other = (load_surface(text, **asdict(reading)) for reading in (inverted, IN_UM))
    settings = structs.replace(load_settings(), reading=inverted)
    with pytest.raises(SettingsError, match="invert"):
        analyze_once(face, settings, other)
