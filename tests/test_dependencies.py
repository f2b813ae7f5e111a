"""What the package imports is what pyproject.toml declares, no more and no less."""

import ast
import re
import sys
import tomllib
from functools import cache

import pytest

from scenes import PROJECT

PROJECT_TABLE = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT_TABLE["optional-dependencies"]
IMPORTED_AS = {
    "pytest-xdist": "xdist",
    "scikit-image": "skimage",
    "pillow": "PIL",
    "vtk": "vtkmodules",
}  # else the distribution's name, with _ for -
PEER, BENCH = "skimage", "studies/bench/"  # is timed where it is installed; no result needs it


def modules(requirements):
    names = [re.match(r"[\w.-]+", one)[0] for one in requirements]
    return {IMPORTED_AS.get(name, name.replace("-", "_")) for name in names}


@cache
def imported():
    """Return name -> files of the package that import it, our own and Python's left out."""
    package, found = PROJECT / "pipeline" / "capslip", {}
    for path in package.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module]
            else:
                continue
            for name in {name.partition(".")[0] for name in names}:
                found.setdefault(name, set()).add(path.relative_to(package).as_posix())
    return {k: v for k, v in found.items() if k not in {"capslip", *sys.stdlib_module_names}}


def test_what_the_package_imports_is_declared_and_what_is_declared_is_imported():
    needed = {
        name
        for name, files in imported().items()
        if not (name == PEER and all(file.startswith(BENCH) for file in files))
    }
    declared = modules(PROJECT_TABLE["dependencies"])
    optional = modules(EXTRAS["vendor"]) | modules(EXTRAS["fleet"])
    assert needed - optional == declared
    assert optional <= needed


@pytest.mark.parametrize("extra", EXTRAS)
def test_an_extra_holds_what_is_used_and_no_dependency_twice(extra):
    assert not modules(EXTRAS[extra]) & modules(PROJECT_TABLE["dependencies"])
    by_tests = set(imported()) | {"mypy", "ruff", "xdist"}  # of `make lint` and `make test`
    for path in (PROJECT / "tests").rglob("*.py"):
        by_tests |= set(re.findall(r"^\s*(?:import|from) (\w+)", path.read_text("utf-8"), re.M))
    by_site = set(re.findall(r'"(\w+)[."]', (PROJECT / "docs" / "conf.py").read_text("utf-8")))
    assert modules(EXTRAS[extra]) <= (by_site if extra == "docs" else by_tests)
