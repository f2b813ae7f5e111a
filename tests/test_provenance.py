"""What a result was made with: other sources, other digests."""

import hashlib
import os
import shutil

import pytest

from capslip import provenance


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Copy the package, so that it may be changed."""
    copy = tmp_path / "capslip"
    shutil.copytree(
        provenance.PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__", "studies")
    )
    monkeypatch.setattr(provenance, "PACKAGE", copy)
    return copy


def digest():
    return provenance.code_sha256.__wrapped__()


@pytest.mark.parametrize("name", ["contact/press.py", "problems.toml", "output/report.html.j2"])
def test_other_sources_are_another_digest(package, name):
    before = digest()
    (package / "notes.txt").write_text("no source")
    assert digest() == before
    path = package / name
    path.write_text(path.read_text() + " ")
    changed = digest()
    assert changed != before
    path.rename(path.with_name(f"other{path.suffix}"))
    assert digest() not in (before, changed)


def test_the_digest_of_a_file_is_that_of_its_bytes(tmp_path):
    (tmp_path / "a").write_bytes(b"scan")
    assert provenance.sha256_of(tmp_path / "a") == hashlib.sha256(b"scan").hexdigest()


def test_what_stands_for_the_digest_of_no_file_says_why(tmp_path):
    (tmp_path / "a").write_bytes(b"scan")
    assert provenance.digest_of(tmp_path / "a") == hashlib.sha256(b"scan").hexdigest()
    os.mkfifo(tmp_path / "pipe")  # which would be waited for
    for path in (tmp_path, tmp_path / "pipe"):
        assert provenance.digest_of(path) == "unread: no file"
    assert provenance.digest_of(tmp_path / "b") == "unread: No such file or directory"


LONG_AGO = (1e9, 1e9)


def put(path, content):
    path.write_bytes(content)
    os.utime(path, LONG_AGO)


@pytest.mark.parametrize("happens", ["nothing", "replaced", "touched", "removed", "appeared"])
def test_a_file_is_as_seen_until_it_changes(tmp_path, happens):
    path, other = tmp_path / "a", tmp_path / "b"
    put(path, b"scan")
    files = provenance.seen_of([path, other])
    assert files[path] == (provenance.state_of(path), None)  # no digest is taken of an old one
    if happens == "replaced":
        put(path, b"nacs")  # size and date are the same
    elif happens == "touched":
        path.touch()
    elif happens == "removed":
        path.unlink()
    elif happens == "appeared":
        put(other, b"scan")
    assert provenance.is_as_seen(files) == (happens == "nothing")


@pytest.mark.parametrize("age_s", [0.0, 3600.0])
def test_of_a_file_that_was_just_written_the_bytes_are_compared(tmp_path, monkeypatch, age_s):
    """No time may tell that it changed: times are coarse, and later for mapped memory."""
    (tmp_path / "a").write_bytes(b"scan")
    os.utime(tmp_path / "a", (os.stat(tmp_path / "a").st_mtime - age_s,) * 2)
    state = provenance.state_of(tmp_path / "a")
    monkeypatch.setattr(provenance, "state_of", lambda _: state)
    files = provenance.seen_of([tmp_path / "a"])
    assert provenance.is_as_seen(files)
    (tmp_path / "a").write_bytes(b"nacs")
    assert provenance.is_as_seen(files) == (age_s > 0.0)


def test_libraries_are_named_with_their_versions():
    import numpy

    assert f"numpy {numpy.__version__}" in provenance.libraries().split(", ")
