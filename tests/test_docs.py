"""The pages name functions, tests, files, folders and targets that exist."""

import ast
import importlib
import re
import shlex
from functools import reduce
from pathlib import Path

import pytest

from capslip.analysis import analyze_once
from capslip.cli import main
from capslip.options import SETTING, settings_of
from capslip.surface.readers import load_surface
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


TWO_FACES = (PROJECT / "docs" / "conditioning.md").read_text(encoding="utf-8")
TWO_FACES = TWO_FACES[TWO_FACES.index("The difference is not small") :].partition("\n## ")[0]


def by_command(line):
    """Return the surface and its mate of a command, and its settings."""
    command = main.commands["analyze"]
    given = command.make_context("analyze", shlex.split(line)[2:]).params
    settings = settings_of(
        given["config"],
        given["overrides"],
        verbose=False,
        **{name: given[name] for name in SETTING if given.get(name) is not None},
    )
    scans = (*given["surfaces"], given["mate"])
    return [load_surface(PROJECT / scan) for scan in scans], settings


def as_printed(found, mate, settings):
    """Return the rows of the table of two faces as numbers, in its units."""
    families, contact, slip = found.families, found.contact, found.slip
    members = [one for one in (families.G, families.P) if one is not None]
    together = settings.mating.way == "together"
    faces = [found, analyze_once(mate, settings)] if together else [found]
    forces_N = [share * slip.total_slip_force_N for share in (0.1, 0.25, 0.5, 0.75)]
    return {
        "Sq": [1e6 * one.conditioned.sq_m for one in faces],
        "caps": [len(found.caps)],
        "families": [one.count for one in members] + [1e6 * (families.h_m or 0.0)] * together,
        "radius": [one.radius_m for one in members],
        "caps that touch": [contact.contacts],
        "approach": [1e6 * contact.approach_m],
        "tangential stiffness": [1e-9 * slip.tangential_stiffness_N_per_m],
        "W at T = 0.1, 0.25, 0.5, 0.75 mu N": [
            1e9 * float(slip.energy_at_force_J(force_N)) for force_N in forces_N
        ],
    }


def test_the_numbers_of_two_faces_are_those_of_their_commands():
    lines = re.findall(r"^    (capslip analyze .+)$", TWO_FACES, re.MULTILINE)
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", TWO_FACES, re.MULTILINE)
    printed = {name: cells for name, *cells in rows if name != "---"}
    assert len(lines) == 2
    known = []
    for column, line in enumerate(lines):
        (surface, mate), settings = by_command(line)
        known.append(as_printed(analyze_once(surface, settings, mate), mate, settings))
        assert known[-1].keys() == printed.keys()
        for name, values in known[-1].items():
            numbers = [float(one) for one in re.findall(r"\d+(?:\.\d+)?", printed[name][column])]
            assert numbers == [float(f"{value:.3g}") for value in values], (name, column)
    together, composite = known
    (softer,) = re.findall(r"softer by (\d+) %", TWO_FACES)
    (more,) = re.findall(r"loses (\S+) times as much", TWO_FACES)
    K, W = "tangential stiffness", "W at T = 0.1, 0.25, 0.5, 0.75 mu N"
    assert softer == f"{100.0 * (1.0 - composite[K][0] / together[K][0]):.0f}"
    assert more == f"{composite[W][-1] / together[W][-1]:.1f}"
