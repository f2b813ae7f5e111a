"""What a result was made with: other sources, other digests."""

import hashlib
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


def test_libraries_are_named_with_their_versions():
    import numpy

    assert f"numpy {numpy.__version__}" in provenance.libraries().split(", ")
