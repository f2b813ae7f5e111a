"""Imports run one way: from the command line down to the errors, never back."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "pipeline" / "capslip"

# Lower number = deeper layer. A module may import from deeper layers, or its own wing's.
LAYERS = [
    {"errors", "problems", "registry"},
    {"settings"},
    {"surface"},
    {"caps"},
    {"contact"},
    {"structure"},
    {"stages"},
    {"sensitivity"},
    {"result"},
    {"analysis"},
    {"output"},
    {"batch", "studies"},
    {"cli"},
]
# The package itself and its entry point only name what they open.
DOORS = {"__init__.py", "__main__.py"}
HEAVY = {"matplotlib", "pyvista", "vtk", "dask", "distributed", "scipy", "skimage", "pandas"}


def layer_of(module: str) -> int:
    wing = module.split(".")[1]
    return next(i for i, names in enumerate(LAYERS) if wing in names)


def imports(tree):
    """Modules that a file imports, wherever it does so, but not for type checking alone."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module


def without_type_checking(tree):
    class Drop(ast.NodeTransformer):
        def visit_If(self, node):
            return None if getattr(node.test, "id", "") == "TYPE_CHECKING" else node

    return Drop().visit(tree)


FILES = sorted(
    path for path in PACKAGE.rglob("*.py") if path.parent != PACKAGE or path.name not in DOORS
)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_run_one_way(path):
    relative = path.relative_to(PACKAGE.parent).with_suffix("")
    module = ".".join(relative.parts)
    tree = without_type_checking(ast.parse(path.read_text(encoding="utf-8")))
    for name in imports(tree):
        if name.startswith("capslip."):
            assert layer_of(name) <= layer_of(module), f"{module} imports {name}, which is above it"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_heavy_libraries_load_where_they_are_used(path):
    tree = without_type_checking(ast.parse(path.read_text(encoding="utf-8")))
    top = ast.Module([n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)], [])
    for name in imports(top):
        assert name.split(".")[0] not in HEAVY, f"{path.name} imports {name} at the top"


def test_only_the_command_line_prints_or_exits():
    for path in FILES:
        if path.name == "cli.py":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                name = ast.unparse(node.func)
                assert name not in {"print", "sys.exit", "exit"}, f"{path.name} calls {name}"
