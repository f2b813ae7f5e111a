"""Damaged files of every built-in format: read, or refused with an error of the project."""

import sys

import pytest
from fuzz_readers import calibration, fuzz_readers, valid_files

from capslip.surface.readers import FORMATS, load_surface


@pytest.mark.long
def test_no_damaged_file_escapes_the_errors_of_the_project(monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)  # slow, and not judged here
    results = fuzz_readers(500, seed=7)
    assert [failure for result in results for failure in result.failures] == []
    for result in results:
        assert result.n_read + result.n_refused == result.n_mutants == 500
        assert min(result.n_read, result.n_refused) > 10, result.name


def test_the_files_before_the_damage_are_sound(tmp_path):
    names = []
    for name, contents in valid_files(tmp_path).items():
        for content in contents:
            path = tmp_path / f"sound.{name}"
            path.write_bytes(content)
            surface = load_surface(path, **calibration(name))
            names.append(surface.origin.file_format)
            assert surface.height_m.size > 0
    assert set(names) == {row.name for row in FORMATS} - {"vendor"}


def test_the_damage_is_the_same_every_time():
    first, second = fuzz_readers(5, 1), fuzz_readers(5, 1)
    assert [(r.n_read, r.n_refused) for r in first] == [(r.n_read, r.n_refused) for r in second]
