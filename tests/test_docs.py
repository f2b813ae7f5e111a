"""The pages name functions, tests, files, folders and targets that exist."""

import ast
import importlib
import re
from functools import reduce
from pathlib import Path

import pytest

from test_house import FLOORS

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
    assert wings == {"caps", "contact", "structure", "studies"}
    assert {file.split("/")[0] for file, _ in verification} == {"tests", "pipeline"}


MAPS = (PROJECT / "docs" / "architecture.md", PROJECT / "CONTRIBUTING.md")
PACKAGE = PROJECT / "pipeline" / "capslip"
CODE = re.compile(r"`([^`\n]+)`")
PLACE = re.compile(r"(?P<path>[\w.-]+(?:/[\w.-]+)*(?:/|\.(?:py|toml|md|svg)))(?::(?P<name>\w+))?")


def places(page):
    """Yield every file and folder that a page names as code, with the name in it."""
    for word in CODE.findall(page.read_text(encoding="utf-8")):
        if match := PLACE.fullmatch(word):
            yield match["path"], match["name"]


def places_in_commands(page):
    """Yield the files that indented commands name, but for those that they write."""
    for line in re.findall(r"^    (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE):
        yield from re.findall(r"(?<![\w/.])(?:tests|pipeline|configs|docs)/[\w./]*", line)


def found(path):
    """Return where a path of a page leads: into the project, or into the package."""
    return next((root / path for root in (PROJECT, PACKAGE) if (root / path).exists()), None)


@pytest.mark.parametrize("page", MAPS, ids=lambda path: path.name)
def test_every_place_that_a_map_of_the_project_names_exists(page):
    named = list(places(page))
    assert len(named) > 20
    for path, name in named:
        file = found(path)
        assert file, f"{page.name} names {path}"
        assert file.is_dir() == path.endswith("/")
        if name:
            tree = ast.parse(file.read_text(encoding="utf-8"))
            names = {getattr(node, "name", None) for node in tree.body}
            for node in tree.body:
                targets = getattr(node, "targets", [getattr(node, "target", None)])
                names |= {target.id for target in targets if isinstance(target, ast.Name)}
            assert name in names, f"{page.name} names {path}:{name}"
    for path in places_in_commands(page):
        assert (PROJECT / path).exists(), f"{page.name} names {path}"


@pytest.mark.parametrize("page", [*MAPS, PROJECT / "README.md"], ids=lambda path: path.name)
def test_every_target_that_a_page_names_exists(page):
    makefile = (PROJECT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"(?:`|^    )make ([a-z]+)", page.read_text("utf-8"), re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"{page.name} names {target}"


def test_the_floors_are_those_that_the_test_of_the_house_holds():
    floors = re.findall(r"^\d+\. (`.+)$", MAPS[0].read_text(encoding="utf-8"), re.MULTILINE)
    assert tuple(set(CODE.findall(floor)) for floor in floors) == FLOORS


def test_the_picture_names_every_room_and_files_that_exist():
    picture = (PROJECT / "docs" / "architecture.svg").read_text(encoding="utf-8")
    rooms = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
    text = " ".join(re.findall(r">([^<>\n]+)<", picture))
    assert rooms <= set(re.findall(r"(\w+)/", text))
    for name in re.findall(r"\b\w+\.(?:py|toml)\b", text):
        assert list(PACKAGE.rglob(name)), f"the picture names {name}"
