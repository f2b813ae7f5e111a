"""The house holds: imports run one way and in no circle, modules and functions stay short."""

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "pipeline" / "capslip"

# From the ground up: a module imports from deeper floors, or from its own room.
FLOORS = (
    {
        "disk",
        "errors",
        "leftovers",
        "materials",
        "provenance",
        "registry",
        "setting_errors",
        "units",
        "waiting",
    },
    {"problems", "settings"},
    {"surface"},
    {"caps"},
    {"contact"},
    {"next_steps", "structure"},
    {"stages"},
    {"pressing"},
    {"caps_hold", "sensitivity"},
    {"summary", "verdict"},
    {"result"},
    {"doubts"},
    {"analysis"},
    {"output"},
    {"batch", "compare", "sources", "studies", "workers"},
    {"cli", "console", "options"},
)
# The package itself and its entry point only name what they open.
DOORS = {"capslip", "capslip.__main__"}
HEAVY = {
    "matplotlib",
    "pyvista",
    "vtk",
    "vtkmodules",
    "dask",
    "distributed",
    "scipy",
    "skimage",
    "pandas",
}
MOST_LINES = 500
MOST_BODY = 60
REASON = re.compile(r"#\s*long:\s*\S+")  # beside the def of a function that has one to be longer


def name_of(path):
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


SOURCES = {name_of(path): path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")}
TREES = {name: ast.parse(text) for name, text in SOURCES.items()}
MODULES = sorted(set(TREES) - DOORS)
every_module = pytest.mark.parametrize("module", MODULES)


def floor_of(module):
    room = module.split(".")[1]
    return next(i for i, rooms in enumerate(FLOORS) if room in rooms)


@cache
def without_type_checking(module):
    """Return the tree of a module without what is imported for type checking alone."""

    class Drop(ast.NodeTransformer):
        def visit_If(self, node):
            return None if getattr(node.test, "id", "") == "TYPE_CHECKING" else node

    return Drop().visit(ast.parse(SOURCES[module]))


def imports(tree):
    """Modules of the project that a tree imports, wherever it does so."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in TREES else node.module


@every_module
def test_imports_run_one_way(module):
    for name in imports(without_type_checking(module)):
        if name.startswith("capslip."):
            assert floor_of(name) <= floor_of(module), f"{module} imports {name}, which is above it"


def test_no_import_runs_in_a_circle():
    graph = {
        module: {name for name in imports(without_type_checking(module)) if name in TREES} - DOORS
        for module in MODULES
    }
    TopologicalSorter(graph).prepare()  # CycleError names the circle


@every_module
def test_heavy_libraries_load_where_they_are_used(module):
    top = [
        node
        for node in without_type_checking(module).body
        if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    for name in imports(ast.Module(top, [])):
        assert name.split(".")[0] not in HEAVY, f"{module} imports {name} at the top"


@every_module
def test_no_module_is_long(module):
    n_lines = SOURCES[module].count("\n")
    assert n_lines <= MOST_LINES, f"{module} has {n_lines} lines; split it"


def body_lines(function):
    """Lines of a function after its docstring."""
    body = function.body
    has_docstring = ast.get_docstring(function) is not None
    first = body[1] if has_docstring and len(body) > 1 else body[0]
    return function.end_lineno - first.lineno + 1


@every_module
def test_no_function_is_long_without_a_reason(module):
    lines = SOURCES[module].splitlines()
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            above = lines[max(node.lineno - 2, 0)]
            if body_lines(node) > MOST_BODY and not REASON.search(above + lines[node.lineno - 1]):
                pytest.fail(f"{module}.{node.name}: {body_lines(node)} lines of body")


@every_module
def test_only_the_command_line_prints_or_exits(module):
    if module == "capslip.cli":
        return
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            assert name not in {"print", "sys.exit", "exit"}, f"{module} calls {name}"


def test_no_rung_or_fit_is_named_outside_its_file():
    """Names of the registries appear as strings in no other module: they are asked for."""
    from capslip.registry import names

    words = {"families", "caps", "contact", "least_squares"}  # of settings and tables, too
    for folder in ("contact.models", "caps.fits"):
        known = set(names(folder)) - words
        for module, tree in TREES.items():
            if module.startswith(f"capslip.{folder}"):
                continue
            found = {
                node.value
                for node in ast.walk(tree)
                if isinstance(node, ast.Constant) and isinstance(node.value, str)
            }
            assert not found & known, f"{module} names {found & known} of {folder}"
