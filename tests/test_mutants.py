"""The script that makes mutants finds a kill and a survivor that were planted."""

import pytest

import mutants

SOURCE = '''def larger(a: "int | None", b):
    """Tell whether a > b."""
    return a > b


def half(x_m, µ=0):
    return 0.5 * x_m
'''
TESTS = """
import tiny


def test_larger():
    assert tiny.larger(2, 1)
    assert not tiny.larger(1, 1)
"""


@pytest.fixture
def root(tmp_path):
    (tmp_path / "pipeline" / "tiny").mkdir(parents=True)
    (tmp_path / "pipeline" / "tiny" / "__init__.py").write_text(SOURCE)
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_tiny.py").write_text(TESTS)
    return tmp_path


def changes(root, source):
    path = root / "pipeline" / "tiny" / "__init__.py"
    path.write_text(source)
    return [
        (one.line, one.text(source).splitlines()[one.line - 1]) for one in mutants.mutants_of(path)
    ]


def test_a_planted_kill_and_a_planted_survivor(root, capsys):
    mutants.main(
        ["--root", str(root), "--module", "pipeline/tiny/*.py", "--sample", "0", "--jobs", "2"]
    )
    out = capsys.readouterr().out.splitlines()
    name = "pipeline/tiny/__init__.py"
    assert out == [
        "5 of 5 mutants of 1 modules, seed 0",
        f"killed   {name}:3  > -> >=  | return a > b",
        f"killed   {name}:3  > -> <=  | return a > b",
        f"survived {name}:6  0 -> 1  | def half(x_m, µ=0):",
        f"survived {name}:7  * -> /  | return 0.5 * x_m",
        f"survived {name}:7  0.5 -> 1.0  | return 0.5 * x_m",
        "2 of 5 killed, 40%",
    ]
    assert (root / "pipeline" / "tiny" / "__init__.py").read_text() == SOURCE


def test_a_sample_is_drawn_by_its_seed(root, capsys, monkeypatch):
    monkeypatch.setattr(mutants, "run_tests", lambda *_: "passed")
    drawn = []
    for seed in ("1", "1", "2"):
        arguments = ["--module", "pipeline/tiny/*.py", "--sample", "2", "--seed", seed]
        mutants.main(["--root", str(root), *arguments])
        drawn.append(capsys.readouterr().out.splitlines()[1:])
    assert drawn[0] == drawn[1] != drawn[2]
    assert [len(lines) for lines in drawn] == [3, 3, 3]


def test_tests_that_fail_without_a_mutant_are_refused(root):
    (root / "tests" / "test_tiny.py").write_text("def test_false():\n    assert False\n")
    with pytest.raises(SystemExit, match="fail already: tests"):
        mutants.main(["--root", str(root), "--module", "pipeline/tiny/*.py", "--sample", "1"])


def test_a_mutant_that_never_ends_is_killed(root, capsys, monkeypatch):
    monkeypatch.setattr(mutants, "SPARE_S", 0.1)
    source = "def wait(ends):\n    while not ends:\n        pass\n"
    (root / "pipeline" / "tiny" / "__init__.py").write_text(source)
    test = "import tiny\n\n\ndef test_wait():\n    tiny.wait(True)\n"
    (root / "tests" / "test_tiny.py").write_text(test)
    mutants.main(["--root", str(root), "--module", "pipeline/tiny/*.py"])
    out = capsys.readouterr().out.splitlines()
    assert (
        out[1]
        == "killed (never ended) pipeline/tiny/__init__.py:2  not  -> nothing  | while not ends:"
    )


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("a = b <= c", {"a = b < c", "a = b > c"}),
        ("a = b == c", {"a = b != c"}),
        ("a = (b) + (c - d)", {"a = (b) - (c - d)", "a = (b) + (c + d)"}),
        ("a = b and not c", {"a = b or not c", "a = b and c"}),
        ("a = -b", {"a = b"}),
        ("a = np.minimum(b, max(c))", {"a = np.maximum(b, max(c))", "a = np.minimum(b, min(c))"}),
        ("a = b.max(axis=0)", {"a = b.min(axis=0)", "a = b.max(axis=1)"}),
        ("a = b.sum(axis=-1)", set()),
        ("a = zip(b, c, strict=True)", set()),
        ("a = b[0]", {"a = b[1]"}),
        ("a = b[1]", {"a = b[0]"}),
        ("a = dy_m", set()),
        ("dx_m = dy_m", {"dx_m = dx_m"}),
        ("a = (0, 3, 0.5, True)", {"a = (1, 3, 0.5, True)", "a = (0, 6, 0.5, True)",
                                   "a = (0, 3, 1.0, True)", "a = (0, 3, 0.5, False)"}),
        ("a += 'µ', b - c", {"a -= 'µ', b - c", "a += 'µ', b + c"}),
        ("def f(a: 'int' = 2, *, b: int | None): 0", {"def f(a: 'int' = 4, *, b: int | None): 0",
                                                     "def f(a: 'int' = 2, *, b: int | None): 1"}),
        ("raise E(a + 1)", set()),
        ("f'{a + 1}'", set()),
        ("'a text of 1 < 2'  # and a > comment", set()),
        ("from a import b as dy", set()),
    ],
)  # fmt: skip
def test_what_is_changed(root, line, expected):
    assert {text for _, text in changes(root, line + "\n")} == expected


def test_every_module_is_named_with_its_tests():
    root = mutants.Path(mutants.__file__).parents[1]
    modules = (root / "pipeline").rglob("[!_]*.py")
    assert not set(modules) - set(mutants.modules(root, []))


def test_every_row_of_the_table_names_a_module():
    (init,) = (mutants.Path(mutants.__file__).parents[1] / "pipeline").glob("*/__init__.py")
    named = set()
    for globs, _ in mutants.TABLE:
        paths = {path for one in globs for path in init.parent.glob(one)}
        assert paths - named, globs
        named |= paths
