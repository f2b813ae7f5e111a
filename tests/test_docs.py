"""The pages in docs/ name functions and tests that exist."""

import importlib
import re
from functools import reduce
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[1]
PAGES = sorted((PROJECT / "docs").glob("*.md"))
NAMED = re.compile(r"`(?P<file>(?:pipeline|tests)/[\w/]+\.py):(?P<name>[\w.]+)`")


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_what_is_named_exists(page):
    for match in NAMED.finditer(page.read_text(encoding="utf-8")):
        file, name = PROJECT / match["file"], match["name"]
        assert file.is_file(), f"{page.name} names {match['file']}"
        if match["file"].startswith("tests/"):
            assert f"def {name}(" in file.read_text(encoding="utf-8"), f"{page.name} names {name}"
        else:
            path = match["file"].removesuffix(".py").removeprefix("pipeline/")
            module = importlib.import_module(path.replace("/", "."))
            assert reduce(getattr, name.split("."), module) is not None


def test_theory_and_verification_name_their_functions():
    theory, verification = (
        NAMED.findall((PROJECT / "docs" / name).read_text(encoding="utf-8"))
        for name in ("theory.md", "verification.md")
    )
    wings = {file.split("/")[2] for file, _ in theory}
    assert wings == {"contact", "structure", "studies"}
    assert {file.split("/")[0] for file, _ in verification} == {"tests", "pipeline"}
