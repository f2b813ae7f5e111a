"""Mutants: change one place of the source at a time and see whether a test fails.

    python tests/mutants.py [--sample N] [--seed S] [--module PATH ...] [--jobs N]

Each mutant lives in a temporary copy of the source, first on PYTHONPATH; the working tree is never
written to. Strings, type hints, decorators and what is raised are left alone. A mutant that no test
sees is printed as `survived`: either a test is missing, or the change is none (`<` for `<=` at a
place that no number hits).
"""

import argparse
import ast
import compileall
import io
import multiprocessing
import os
import py_compile
import random
import shutil
import signal
import sys
import tempfile
import time
import tokenize
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from queue import SimpleQueue

SOURCE = "pipeline"
# Globs of modules, below the package, and of the tests that concern them, the quickest first. The
# first row that names a module counts; `{stem}` is its name. A glob that finds nothing is passed
# over, so that a file may move to one of its places.
TABLE = [
    (
        (
            "structure/law.py",
            "structure/law_errors.py",
            "structure/beds.py",
            "structure/interpolation.py",
            "output/exports/law.py",
        ),
        ("tests/structure/test_structure_law.py", "tests/output/test_output_law.py"),
    ),
    (
        ("contact/press.py", "contact/bulk.py", "contact/rung.py"),
        (
            "tests/contact/test_*limits*.py",
            "tests/contact/test_*curves*.py",
            "tests/contact/test_*press*.py",
            "tests/contact/test_*models*.py",
        ),
    ),
    (
        (
            "contact/choice.py",
            "contact/accuracy.py",
            "contact/moved.py",
            "contact/reach.py",
            "contact/certificate.py",
        ),
        (
            "tests/contact/test_*certificate*.py",
            "tests/contact/test_*reach*.py",
            "tests/contact/test_*accuracy*.py",
            "tests/contact/test_*moved*.py",
            "tests/contact/test_*choice*.py",
            "tests/contact/test_*press*.py",
        ),
    ),
    (
        ("surface/taken_form.py",),
        ("tests/surface/test_*conditioning*.py", "tests/contact/test_contact_effects.py"),
    ),
    (
        ("contact/time_needed.py",),
        ("tests/test_next_steps.py", "tests/contact/test_*time_limit*.py"),
    ),
    (
        ("surface/doubts.py", "surface/holes.py", "surface/outline.py"),
        (
            "tests/surface/test_*doubts*.py",
            "tests/surface/test_*holes*.py",
            *("tests/surface/test_*seams*.py", "tests/surface/test_*conditioning*.py"),
            *("tests/surface/test_*outliers*.py", "tests/surface/test_*filling*.py"),
        ),
    ),
    (
        ("surface/flatness.py",),
        (
            *("tests/surface/test_*doubts*.py", "tests/test_verdict.py"),
            "tests/surface/test_*average*.py",
        ),
    ),
    (
        ("surface/graph.py", "surface/rows.py", "surface/steps.py"),
        (
            *("tests/surface/test_*blocks*.py", "tests/surface/test_*conditioning*.py"),
            *("tests/surface/test_*lifted*.py", "tests/surface/test_*outliers*.py"),
        ),
    ),
    (("surface/heights.py",), ("tests/surface/test_*heightmap*.py",)),
    (
        ("surface/repeats.py",),
        ("tests/surface/test_*average*.py", "tests/command_line/test_cli_average.py"),
    ),
    (("surface/placing.py",), ("tests/surface/test_*placing*.py",)),
    (("surface/shifts.py",), ("tests/surface/test_*mating*.py", "tests/surface/test_*average*.py")),
    (("surface/spectrum.py",), ("tests/surface/test_*parameters*.py",)),
    (("surface/readers/*.py",), ("tests/surface/test_*readers*.py",)),
    (("surface/*.py",), ("tests/surface/test_*_{stem}.py",)),
    (
        (
            *("contact/effects.py", "contact/trials.py", "contact/map_accuracy.py"),
            "contact/map_doubts.py",
        ),
        (
            *("tests/contact/test_*trials*.py", "tests/contact/test_*effects_told*.py"),
            *("tests/contact/test_*effects*.py", "tests/contact/test_*detail*.py"),
            "tests/contact/test_*noise*.py",
        ),
    ),
    (
        (
            *("caps/fit.py", "caps/fits/*.py", "caps/fitting.py", "caps/spheres.py"),
            *("caps/body.py", "caps/flags.py", "caps/profile.py", "caps/apex.py"),
            *("caps/noise.py", "caps/quadric.py", "caps/points.py", "caps/table.py"),
        ),
        (
            *("tests/caps/test_*quadric*.py", "tests/caps/test_*apex*.py"),
            *("tests/caps/test_*body*.py", "tests/caps/test_*profile*.py"),
            *("tests/caps/test_*noise.py", "tests/caps/test_*points*.py"),
            *("tests/caps/test_*flags*.py", "tests/caps/test_*fit*.py"),
            "tests/caps/test_*errors*.py",
        ),
    ),
    (
        ("caps/families.py", "caps/clusters.py", "caps/planes.py"),
        ("tests/caps/test_*families*.py", "tests/caps/test_*levels*.py"),
    ),
    (("caps/separation.py", "caps/hills.py"), ("tests/caps/test_*hills*.py",)),
    (("caps/simplex.py",), ("tests/caps/test_*levels*.py", "tests/caps/test_*resting*.py")),
    (("caps/features.py", "caps/iso25178.py"), ("tests/surface/test_*parameters*.py",)),
    (("caps/*.py",), ("tests/caps/test_*{stem}*.py",)),
    (
        (
            *("contact/joint.py", "contact/pressure_map.py", "contact/uneven.py"),
            "contact/part_of_joint.py",
        ),
        ("tests/contact/test_*uneven*.py", "tests/contact/test_*joint*.py"),
    ),
    (
        ("contact/given.py", "contact/models/families.py"),
        (
            *("tests/command_line/test_cli_families.py", "tests/contact/test_*curves*.py"),
            *("tests/contact/test_*slip*.py", "tests/contact/test_*limits*.py"),
        ),
    ),
    (
        ("contact/models/boundary_elements.py", "contact/map_curve.py", "contact/at_holes.py"),
        (
            *("tests/contact/test_*nearby*.py", "tests/contact/test_*time_limit*.py"),
            *("tests/contact/test_*at_holes*.py", "tests/contact/test_*boundary_elements*.py"),
            "tests/contact/test_*yielding_map*.py",
        ),
    ),
    (
        ("contact/models/*.py", "contact/curve.py", "contact/scaled.py"),
        (
            *("tests/contact/test_*curves*.py", "tests/contact/test_*models*.py"),
            *("tests/contact/test_*slip*.py", "tests/contact/test_*{stem}*.py"),
            "tests/structure/test_structure_law.py",
        ),
    ),
    (("contact/direction.py",), ("tests/contact/test_*lay.py",)),
    (("contact/depth.py",), ("tests/test_stages.py",)),
    (
        ("contact/flattening.py",),
        ("tests/contact/test_*yielding.py", "tests/contact/test_*moved*.py"),
    ),
    (
        ("contact/balanced.py",),
        ("tests/contact/test_*moved*.py", "tests/contact/test_*levelling*.py"),
    ),
    (
        ("contact/doubts.py", "contact/uneven_accuracy.py"),
        ("tests/contact/test_*doubts*.py", "tests/contact/test_*uneven*.py"),
    ),
    (("contact/families_accuracy.py",), ("tests/contact/test_*families_accuracy*.py",)),
    (("contact/steepness.py",), ("tests/contact/test_*steepness*.py",)),
    (("contact/turns.py",), ("tests/contact/test_*levelling*.py",)),
    (("contact/solvers/nearby.py",), ("tests/contact/test_*nearby*.py",)),
    (("contact/solvers/sinking.py",), ("tests/contact/test_*sinking*.py",)),
    (
        (
            *("contact/solvers/metal.py", "contact/solvers/withdrawn.py"),
            *("contact/plastic_law.py", "contact/as_metal.py"),
        ),
        (
            *("tests/contact/test_*plastic_law*.py", "tests/contact/test_*yielding_map*.py"),
            "tests/contact/test_*as_metal*.py",
        ),
    ),
    (
        ("contact/solvers/refinement.py",),
        (
            *("tests/contact/test_*patches*.py", "tests/contact/test_*between*.py"),
            *("tests/contact/test_*yielding_map*.py", "tests/contact/test_*spline*.py"),
        ),
    ),
    (
        ("contact/solvers/unloading.py", "contact/solvers/path.py", "contact/solvers/losses.py"),
        (
            "tests/contact/test_*losses_closed.py",
            *("tests/contact/test_*losses*.py", "tests/contact/test_*patches*.py"),
            *("tests/contact/test_*pixels*.py", "tests/contact/test_*tilting*.py"),
        ),
    ),
    (
        ("contact/solvers/detail.py", "contact/solvers/whiteness.py"),
        (
            *("tests/contact/test_*detail_filter*.py", "tests/contact/test_*detail*.py"),
            "tests/contact/test_*noise*.py",
        ),
    ),
    (
        ("contact/solvers/solutions.py", "contact/solvers/pressed.py"),
        (
            *("tests/contact/test_*time_limit*.py", "tests/contact/test_*nearby*.py"),
            *("tests/contact/test_*press.py", "tests/contact/test_*boundary_elements*.py"),
        ),
    ),
    (
        (
            *("contact/solvers/polonsky_keer.py", "contact/solvers/half_space.py"),
            *("contact/solvers/elastic_face.py", "contact/solvers/patched_half_space.py"),
            *("contact/solvers/steps.py", "contact/solvers/waves.py"),
        ),
        (
            *("tests/contact/test_*pixels*.py", "tests/contact/test_*rough_inverse*.py"),
            *("tests/contact/test_*patches*.py", "tests/contact/test_*boundary_elements*.py"),
            *("tests/contact/test_*tangential*.py", "tests/contact/test_*steps*.py"),
        ),
    ),
    (
        ("contact/solvers/hertz.py",),
        ("tests/contact/test_*curves*.py", "tests/contact/test_*models*.py"),
    ),
    (("contact/*.py", "contact/solvers/*.py"), ("tests/contact/test_*{stem}*.py",)),
    (("structure/answer.py", "units.py"), ("tests/structure/test_*answer*.py",)),
    (
        ("disk.py",),
        (
            "tests/test_disk.py",
            "tests/output/test_*staging*.py",
            "tests/output/test_*convert*.py",
            "tests/surface/test_surface_readers.py",
        ),
    ),
    (
        ("structure/band.py", "structure/band_*.py"),
        ("tests/structure/test_*band_parts.py", "tests/structure/test_*{stem}*.py"),
    ),
    (("structure/*.py",), ("tests/structure/test_*{stem}*.py",)),
    (("output/exports/jenkins.py",), ("tests/output/test_*rows*.py", "tests/output/test_*law.py")),
    (("output/quantity.py", "output/terminal.py"), ("tests/output/test_*rows*.py",)),
    (("output/formats/*.py",), ("tests/output/test_*convert*.py",)),
    (("output/export.py",), ("tests/output/test_*law.py",)),
    (
        ("output/datasets.py", "output/folder.py"),
        ("tests/output/test_*tables*.py", "tests/output/test_*folder*.py"),
    ),
    (
        ("output/lead.py", "output/methods.py"),
        (
            *("tests/output/test_*{stem}.py", "tests/test_verdict.py"),
            "tests/output/test_*report*.py",
        ),
    ),
    (
        ("output/figures*.py", "output/canvas.py"),
        ("tests/output/test_*figures*.py", "tests/output/test_*plots*.py"),
    ),
    (("output/thumbnail.py",), ("tests/output/test_*overview*.py",)),
    (
        ("output/picture.py", "output/drawing.py", "output/renderer.py"),
        ("tests/output/test_*view.py", "tests/output/test_*scene*.py"),
    ),
    (("output/arrays.py",), ("tests/output/test_*zones*.py", "tests/test_python_api.py")),
    (("output/*.py",), ("tests/output/test_*{stem}*.py",)),
    (("compare/*.py",), ("tests/compare/test_*.py",)),
    (
        ("studies/faces/*.py",),
        ("tests/surface/test_*synthetic*.py", "tests/surface/test_*samples*.py"),
    ),
    (("studies/paper/*.py", "studies/page.py"), ("tests/studies/test_reproduce.py",)),
    (("studies/clock.py",), ("tests/studies/test_bench.py",)),
    (
        (
            "studies/real_scans.py",
            "studies/validation.py",
            "studies/plastic_sphere.py",
            "studies/plastic_tops.py",
        ),
        ("tests/studies/test_{stem}.py",),
    ),
    *(
        ((f"studies/{name}/*.py",), (f"tests/studies/test_{name}*.py",))
        for name in ("band", "bench", "chart", "level", "limits", "theorem")
    ),
    (
        ("analysis.py", "__init__.py"),
        (
            "tests/test_analysis.py",
            *("tests/test_python_api.py", "tests/command_line/test_cli_families.py"),
            *("tests/contact/test_*scans*.py", "tests/output/test_*scans*.py"),
            "tests/output/test_*summary*.py",
        ),
    ),
    (
        ("doubts.py",),
        (
            *("tests/test_doubts.py", "tests/contact/test_*doubts*.py", "tests/test_stages.py"),
            *("tests/test_verdict.py", "tests/test_second_face.py"),
        ),
    ),
    (
        ("problems.py", "registry.py", "materials.py", "errors.py"),
        (
            *("tests/test_problems.py", "tests/caps/test_*registry*.py"),
            "tests/command_line/test_cli_small.py",
        ),
    ),
    (
        ("pressing.py",),
        (
            *("tests/test_stages.py", "tests/contact/test_*uneven*.py"),
            *("tests/contact/test_*lay.py", "tests/contact/test_*levelling.py"),
            "tests/contact/test_*tilting.py",
        ),
    ),
    (("caps_hold.py",), ("tests/output/test_output_law.py",)),
    (
        ("stages.py", "settings.py", "setting_errors.py"),
        ("tests/test_stages.py", "tests/caps/test_*registry*.py", "tests/test_verdict.py"),
    ),
    (
        ("result.py", "summary.py"),
        (
            *("tests/output/test_*summary*.py", "tests/output/test_*scans*.py"),
            "tests/test_python_api.py",
        ),
    ),
    (
        ("batch.py",),
        ("tests/command_line/test_batch_parts.py", "tests/command_line/test_cli_batch.py"),
    ),
    (
        ("sources.py",),
        ("tests/command_line/test_{stem}.py", "tests/command_line/test_cli_fleet.py"),
    ),
    (
        ("workers.py",),
        ("tests/command_line/test_workers.py", "tests/command_line/test_cli_batch.py"),
    ),
    (
        ("console.py", "waiting.py"),
        ("tests/command_line/test_cli_console.py", "tests/contact/test_*waiting*.py"),
    ),
    (
        ("cli.py", "options.py"),
        (
            *("tests/command_line/test_cli_parts.py", "tests/command_line/test_batch_parts.py"),
            *("tests/command_line/test_cli_small.py", "tests/command_line/test_cli_errors.py"),
            *("tests/command_line/test_cli_models.py", "tests/command_line/test_cli_analyze.py"),
        ),
    ),
    (("*.py",), ("tests/test_{stem}.py",)),
]
SAMPLE = 40
LIBRARIES = [
    *("pytest", "_pytest.assertion.rewrite", "numpy", "msgspec", "scipy.fft", "scipy.ndimage"),
    *("scipy.linalg", "scipy.optimize", "scipy.special", "scipy.spatial", "scipy.sparse.linalg"),
]
WARM = multiprocessing.get_context("forkserver")
SLOWER = 4.0  # times the tests without a mutant, and
SPARE_S = 30.0  # more, until a mutant counts as killed by never ending

OTHERS = {
    "<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"),
    "==": ("!=",), "!=": ("==",), "+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",),
    "&": ("|",), "|": ("&",), "and": ("or",), "or": ("and",),
    "+=": ("-=",), "-=": ("+=",), "*=": ("/=",), "/=": ("*=",), "&=": ("|=",), "|=": ("&=",),
}  # fmt: skip
EXTREMES = [
    ("min", "max"), ("minimum", "maximum"), ("fmin", "fmax"), ("nanmin", "nanmax"),
    ("argmin", "argmax"),
]  # fmt: skip
AXES = [("dy", "dx"), ("dy_m", "dx_m"), ("y_m", "x_m"), ("ny", "nx")]  # where a module has both
TWINS = {a: b for pair in EXTREMES + AXES for a, b in (pair, pair[::-1])}


@dataclass(frozen=True)
class Mutant:
    """One change of one line; columns count characters."""

    path: Path
    line: int  # from 1
    begin: int
    end: int
    new: str

    def text(self, source: str) -> str:
        """Return the source with the change made."""
        lines = source.splitlines(keepends=True)
        old = lines[self.line - 1]
        lines[self.line - 1] = old[: self.begin] + self.new + old[self.end :]
        return "".join(lines)

    def describe(self, root: Path, source: str) -> str:
        """Return `file:line  old -> new  | the line`."""
        line = source.splitlines()[self.line - 1]
        old = line[self.begin : self.end]
        where = f"{self.path.relative_to(root)}:{self.line}"
        return f"{where}  {old} -> {self.new or 'nothing'}  | {line.strip()}"


class _Finder:
    """Finds what can be changed in one module."""

    def __init__(self, path: Path, source: str) -> None:
        self.path, self.lines, self.found = path, source.splitlines(), list[Mutant]()
        tokens = tokenize.generate_tokens(io.StringIO(source).readline)
        self.tokens = [t for t in tokens if t.type in (tokenize.OP, tokenize.NAME)]
        self.names = {t.string for t in self.tokens} | {name for pair in EXTREMES for name in pair}

    def place(self, line: int, byte: int) -> tuple[int, int]:
        """Return line and character of a place that `ast` counts in bytes."""
        return line, len(self.lines[line - 1].encode()[:byte].decode())

    def begin(self, node: ast.expr) -> tuple[int, int]:
        return self.place(node.lineno, node.col_offset)

    def end(self, node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self.place(node.end_lineno, node.end_col_offset)

    def add(self, begin: tuple[int, int], end: tuple[int, int], *news: str) -> None:
        if begin[0] == end[0]:
            self.found += [Mutant(self.path, begin[0], begin[1], end[1], new) for new in news]

    def between(self, one: tuple[int, int], other: tuple[int, int]) -> None:
        """Change the operator between two operands."""
        for token in self.tokens:
            if one <= token.start and token.end <= other and token.string in OTHERS:
                self.add(token.start, token.end, *OTHERS[token.string])
                return

    def name(self, node: ast.expr, name: str) -> None:
        if TWINS.get(name) in self.names:
            line, end = self.end(node)
            self.add((line, end - len(name)), (line, end), TWINS[name])

    def constant(self, node: ast.expr, swap: bool = False) -> None:
        """Change a number or a truth value; `swap` makes 0 of 1, where it tells two apart."""
        value = node.value if isinstance(node, ast.Constant) else None
        new = ""
        if isinstance(value, bool):
            new = str(not value)
        elif value == 0 or (swap and value == 1):
            new = repr(type(value)(1 - value))  # type: ignore[operator]
        elif isinstance(value, int | float):
            new = repr(2 * value)
        if new:
            self.add(self.begin(node), self.end(node), new)

    def visit(self, node: ast.AST) -> None:
        """Look at a node and at what lies in it, but not at texts and types."""
        if isinstance(node, ast.JoinedStr | ast.Raise | ast.Import | ast.ImportFrom):
            return
        if isinstance(node, ast.If) and ast.unparse(node.test).startswith(("TYPE_CH", "__name__")):
            return
        skipped = {"annotation", "returns", "decorator_list", "type_params"}
        if isinstance(node, ast.Compare):
            operands = [node.left, *node.comparators]
            for one, other in pairwise(operands):
                self.between(self.end(one), self.begin(other))
        elif isinstance(node, ast.BinOp):
            self.between(self.end(node.left), self.begin(node.right))
        elif isinstance(node, ast.BoolOp):
            for one, other in pairwise(node.values):
                self.between(self.end(one), self.begin(other))
        elif isinstance(node, ast.AugAssign):
            self.between(self.end(node.target), self.begin(node.value))
        elif isinstance(node, ast.UnaryOp):
            self.add(self.begin(node), self.begin(node.operand), "")  # no `not`, `-`, `~`
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            self.name(node, node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
            self.name(node, node.attr)
        elif isinstance(node, ast.Constant):
            self.constant(node)
        elif isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
            self.constant(node.slice, swap=True)
            skipped.add("slice")
        elif isinstance(node, ast.keyword) and node.arg == "axis":
            self.constant(node.value, swap=True)
            skipped.add("value")  # the last of two axes is the second
        elif isinstance(node, ast.keyword) and node.arg == "strict":
            skipped.add("value")  # checks what never happens
        for field, inner in ast.iter_fields(node):
            if field not in skipped:
                for child in inner if isinstance(inner, list) else [inner]:
                    if isinstance(child, ast.AST):
                        self.visit(child)


def mutants_of(path: Path) -> list[Mutant]:
    """Return every mutant of a module that is valid Python."""
    source = path.read_text(encoding="utf-8")
    finder = _Finder(path, source)
    finder.visit(ast.parse(source))
    return [one for one in finder.found if _compiles(one.text(source))]


def _compiles(text: str) -> bool:
    try:
        compile(text, "mutant", "exec")
    except SyntaxError:
        return False
    return True


def modules(root: Path, asked: list[str]) -> dict[Path, tuple[str, ...]]:
    """Return the modules, those asked for or all of the table, with the tests of each."""
    (package,) = (path.parent for path in (root / SOURCE).glob("*/__init__.py"))
    known: dict[Path, tuple[str, ...]] = {}
    for globs, tests in TABLE:
        for path in sorted({path for one in globs for path in package.glob(one)}):
            known.setdefault(path, _existing(root, [one.format(stem=path.stem) for one in tests]))
    if not asked:
        return {path: tests for path, tests in known.items() if tests}
    found = {}
    for name in asked:
        paths = sorted(path for path in root.glob(name) if path.suffix == ".py")
        if not paths:
            raise SystemExit(f"--module {name}: no such module below {root}")
        for path in paths:
            found[path] = known.get(path) or _existing(root, ["tests"])
    return found


def _existing(root: Path, globs: Iterable[str]) -> tuple[str, ...]:
    paths = [path for one in globs for path in sorted(root.glob(one))]
    return tuple(dict.fromkeys(str(path.relative_to(root)) for path in paths))


def run_tests(root: Path, copy: Path, tests: tuple[str, ...], timeout_s: float | None) -> str:
    """Run tests on a copy of the source; return "passed", "failed" or "never ended".

    They run in a fork of a process that has imported the libraries, but nothing of the source.
    """
    process = WARM.Process(target=_pytest, args=(str(root), str(copy), tests))
    process.start()
    try:
        process.join(timeout_s)
        if process.is_alive():
            return "never ended"
        return "failed" if process.exitcode else "passed"
    finally:
        if process.is_alive() and process.pid is not None:
            os.killpg(process.pid, signal.SIGKILL)  # with what the tests started
            process.join()


def _pytest(root: str, copy: str, tests: tuple[str, ...]) -> None:
    import pytest

    os.setsid()
    null = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(null, stream)
    paths = [copy, *filter(None, [os.environ.get("PYTHONPATH")])]
    os.environ["PYTHONPATH"] = os.pathsep.join(paths)
    sys.path.insert(0, copy)
    sys.dont_write_bytecode = True  # two mutants of one second and size would share it
    os.chdir(root)
    os._exit(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *tests]))


def results(
    root: Path, chosen: list[Mutant], tests: dict[Path, tuple[str, ...]], jobs: int
) -> Iterator[tuple[Mutant, str]]:
    """Yield each mutant with what its tests did, as soon as it is known and in the order given."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(jobs) as pool:
        copies: SimpleQueue[Path] = SimpleQueue()
        for job in range(jobs):
            copy = Path(folder) / str(job)
            shutil.copytree(root / SOURCE, copy, ignore=shutil.ignore_patterns("__pycache__"))
            compiled = py_compile.PycInvalidationMode.CHECKED_HASH
            compileall.compile_dir(copy, quiet=1, invalidation_mode=compiled)
            copies.put(copy)

        def timed(names: tuple[str, ...]) -> float:
            copy, begin = copies.get(), time.perf_counter()
            try:
                if run_tests(root, copy, names, None) != "passed":
                    raise SystemExit(f"without a mutant these fail already: {' '.join(names)}")
            finally:
                copies.put(copy)
            return SLOWER * (time.perf_counter() - begin) + SPARE_S

        sets = list(dict.fromkeys(tests[one.path] for one in chosen))
        most_s = dict(zip(sets, pool.map(timed, sets), strict=True))

        def outcome(one: Mutant) -> str:
            copy = copies.get()
            mutated = copy / one.path.relative_to(root / SOURCE)
            source = one.path.read_text(encoding="utf-8")
            mutated.write_text(one.text(source), encoding="utf-8")
            try:
                return run_tests(root, copy, tests[one.path], most_s[tests[one.path]])
            finally:
                mutated.write_text(source, encoding="utf-8")
                copies.put(copy)

        yield from zip(chosen, pool.map(outcome, chosen), strict=True)


def main(arguments: list[str] | None = None) -> None:
    """Print each mutant with its fate, and the share that was killed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--sample", type=int, default=SAMPLE, help="how many; 0: all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--module", action="append", default=[], help="path or glob, repeatable")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--root", type=Path, default=Path(__file__).parents[1])
    options = parser.parse_args(arguments)
    root = options.root.resolve()
    os.environ.update(OPENBLAS_NUM_THREADS="1", PYTEST_DISABLE_PLUGIN_AUTOLOAD="1")
    WARM.set_forkserver_preload(LIBRARIES)
    tests = modules(root, options.module)
    every = [one for path in tests for one in mutants_of(path)]
    chosen = every
    if 0 < options.sample < len(every):
        picked = random.Random(options.seed).sample(range(len(every)), options.sample)
        chosen = [every[i] for i in sorted(picked)]
    print(f"{len(chosen)} of {len(every)} mutants of {len(tests)} modules, seed {options.seed}")
    killed = 0
    for one, outcome in results(root, chosen, tests, options.jobs):
        killed += outcome != "passed"
        fate = {"passed": "survived", "failed": "killed"}.get(outcome, "killed (never ended)")
        print(f"{fate:8} {one.describe(root, one.path.read_text(encoding='utf-8'))}", flush=True)
    print(f"{killed} of {len(chosen)} killed" + (f", {killed / len(chosen):.0%}" if chosen else ""))


if __name__ == "__main__":
    main()
