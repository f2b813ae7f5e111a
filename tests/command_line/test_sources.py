"""The scans of a batch: which files are some, what a list says of each, and their names."""

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from capslip.errors import NothingToDoError, SettingsError
from capslip.output.staging import SCHEMA
from capslip.settings import load_settings
from capslip.sources import MOST_BYTES, Scan, _names, _plain, find_scans

SETTINGS = load_settings(overrides=("contact.tolerance=0.1",))


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files(*names):
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).touch()


def found(*sources, **options):
    scans, skipped = find_scans(sources, SETTINGS, **options)
    return [str(one.path.relative_to(Path.cwd())) for one in scans], dict(skipped)


@pytest.mark.usefixtures("here")
def test_a_folder_gives_its_files_and_counts_what_it_leaves_out():
    files("in/b.h5", "in/a.x3p", "in/.hidden", "in/deep/c.h5", "in/old/summary.json", "in/x.TOML")
    files("in/old/d.h5", "in/out/e.h5", "in/deep/.f.h5", "in/deep/out/g.h5")
    flat = {"hidden": 1, "document": 1, "folder (see --recursive)": 3}
    assert found("in") == (["in/a.x3p", "in/b.h5"], flat)
    deep, skipped = found("in", recursive=True, leave_out=Path("in/out"))
    assert deep == ["in/a.x3p", "in/b.h5", "in/deep/c.h5", "in/deep/out/g.h5"]
    assert skipped == {"hidden": 2, "document": 1, "result": 1, "folder of this batch": 1}
    deep, skipped = found("in", recursive=True, leave_out=Path("in/deep/out"))
    assert deep == ["in/a.x3p", "in/b.h5", "in/deep/c.h5", "in/out/e.h5"]
    assert skipped["folder of this batch"] == 1
    assert "in/out/e.h5" in found("in", recursive=True)[0]


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("recursive", [False, True])
@pytest.mark.parametrize("source", ["in", "in/*"])
def test_leftovers_of_file_managers_are_left_out_as_what_is_hidden(source, recursive):
    files("in/a.x3p", "in/Thumbs.db", "in/desktop.ini", "in/~$a.xlsx", "in/__MACOSX/._a.x3p")
    assert found(source, recursive=recursive) == (["in/a.x3p"], {"hidden": 4})


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("goal", ["loop.h5", "nowhere", "other.h5"])
def test_a_link_to_no_file_is_skipped_and_ends_nothing(goal):
    files("in/a.h5", "in/b.h5")
    Path("in/loop.h5").symlink_to(goal)
    Path("in/other.h5").symlink_to("loop.h5")
    Path("in/sound.h5").symlink_to("a.h5")
    assert found("in") == (["in/a.h5", "in/b.h5", "in/sound.h5"], {"no file": 2})
    assert found("in/*.h5") == found("in")


@pytest.mark.usefixtures("here")
def test_a_glob_gives_the_files_that_it_hits_and_a_file_of_such_a_name_is_itself():
    files("a1.h5", "a2.h5", "a[12].h5", "b.h5", "deep/a3.h5")
    Path("a4.h5").mkdir()
    assert found("a?.h5") == (["a1.h5", "a2.h5"], {"no file": 1})
    assert found("a[12].h5") == (["a[12].h5"], {})
    assert found("**/a3.h5") == (["deep/a3.h5"], {})
    assert found("b.h5", "notes.toml") == (["b.h5", "notes.toml"], {})  # which fails, by name
    with pytest.raises(NothingToDoError, match=r"no scan found in a4\*; skipped: 1 no file; exp"):
        found("a4*")
    with pytest.raises(NothingToDoError, match=r"no scan found in c\.h5; \S*/c\.h5 is no file; "):
        found("c.h5")


def test_a_list_says_of_each_scan_its_mate_group_preload_and_unit(here):
    rows = "left.h5,right.h5,joint 1,300,um\n ,,,,\nsub/b.h5, , , ,\n"
    (here / "lists").mkdir()
    (here / "lists" / "a.csv").write_text(
        f'"scan",mate,group, preload_N ,unit\n{rows}', "utf-8-sig"
    )
    files("lists/left.h5")
    (left, other), skipped = find_scans((), SETTINGS, Path("lists/a.csv"))
    assert (left.path, left.group) == (here / "lists" / "left.h5", "joint 1")
    assert left.mate == here / "lists" / "right.h5"  # a worker may be in another folder
    assert (left.settings.contact.preload_N, left.settings.reading.unit) == (300.0, "um")
    assert left.settings.contact.tolerance == 0.1
    assert left.settings.is_given("contact.preload_N")
    assert other == Scan(here / "lists" / "sub" / "b.h5", SETTINGS, None, None, "b")
    assert not skipped


def test_a_unit_alone_leaves_the_preload_as_it_is(here):
    files("a.h5")
    (here / "a.csv").write_text("scan,unit\na.h5,nm\n")
    ((one,), _) = find_scans((), SETTINGS, here / "a.csv")
    assert one.settings.reading.unit == "nm"
    assert one.settings.contact == SETTINGS.contact
    assert not one.settings.is_given("contact.preload_N")


@pytest.mark.parametrize("columns", ["", "scan,preload_N\n"])
def test_remarks_in_a_list_are_no_scans(here, columns):
    cells = ",3" if columns else ""
    files("a.h5", "b.h5")
    (here / "a.csv").write_text(f"# of May, all\n{columns}a.h5{cells}\n#b.h5{cells}\n")
    ((one,), _) = find_scans((), SETTINGS, here / "a.csv")
    assert one.path.name == "a.h5"


@pytest.mark.parametrize("blank", ["\n", " \t\n\n", ",,\n", "\n# of May\n\n"])
@pytest.mark.parametrize("columns", ["", "scan,preload_N,group\n"])
def test_blank_lines_before_the_first_are_no_lines(here, columns, blank):
    files("a.h5")
    (here / "a.csv").write_text(f"{blank}{columns}a.h5{',3,x' if columns else ''}\n{blank}")
    ((one,), _) = find_scans((), SETTINGS, here / "a.csv")
    assert (one.path, one.group) == (here / "a.h5", "x" if columns else None)
    assert one.settings.contact.preload_N == (3.0 if columns else SETTINGS.contact.preload_N)


@pytest.mark.parametrize("code", ["latin-1", "utf-8", "utf-8-sig", "utf-16"])
def test_a_unit_and_a_group_are_texts_in_whatever_code_the_list_is(here, code):
    files("a.h5")
    (here / "a.csv").write_bytes("scan,group,unit,preload_N\na.h5,Stößel,µm,3\n".encode(code))
    ((one,), _) = find_scans((), SETTINGS, here / "a.csv")
    assert (one.group, one.settings.reading.unit) == ("Stößel", "µm")
    assert one.settings.contact.preload_N == 3.0
    assert one.settings.sha256()
    words = r"preload_N: got '3µ'; expected a force"
    (here / "a.csv").write_bytes("scan,preload_N\na.h5,3µ\n".encode(code))
    with pytest.raises(SettingsError, match=words):
        find_scans((), SETTINGS, here / "a.csv")


def test_a_path_in_a_list_keeps_its_bytes_whatever_they_are(here):
    for name in (b"caf\xe9.h5", b"caf\xc3\xa9.h5"):
        files(os.fsdecode(name))
        (here / "a.csv").write_bytes(b"scan,mate,group\n%b,%b,\xe9\n" % (name, name))
        ((one,), _) = find_scans((), SETTINGS, here / "a.csv")
        assert os.fsencode(one.path.name) == os.fsencode(one.mate.name) == name
        assert one.group == "é"


def test_a_scan_whose_name_begins_as_a_remark_is_found(here):
    files("a.h5", "#1.h5")
    (here / "a.txt").write_text("#1.h5\n#a.h5\na.h5\n")
    scans, _ = find_scans((), SETTINGS, here / "a.txt")
    assert [scan.path.name for scan in scans] == ["#1.h5", "a.h5"]


def test_a_plain_list_is_a_scan_a_line_and_may_hold_commas(here):
    files("a, 1.h5", "b.h5")
    (here / "list.txt").write_text("a, 1.h5\n\n  b.h5  \r\nb.h5\n", "utf-16")
    scans, _ = find_scans((), SETTINGS, here / "list.txt")
    assert [(one.path.name, one.settings) for one in scans] == [
        ("a, 1.h5", SETTINGS),
        ("b.h5", SETTINGS),
    ]
    (here / "list.txt").write_text("")
    with pytest.raises(NothingToDoError, match=r"no scan found in \S*list\.txt; expected files"):
        find_scans((), SETTINGS, here / "list.txt")
    with pytest.raises(SettingsError, match=r"none\.txt: No such file"):
        find_scans((), SETTINGS, here / "none.txt")


def scan(path, preload_N=None, group=None, mate=None):
    texts = () if preload_N is None else (f"contact.preload_N={preload_N}",)
    return Scan(Path(path), load_settings(overrides=texts), mate, group)


def test_a_name_is_as_much_of_the_path_as_tells_the_scans_apart():
    assert _names([scan("x/a.h5"), scan("x/b.h5")]) == ["a", "b"]
    assert _names([scan("x/a.h5"), scan("x/A.x3p"), scan("x/b.h5")]) == ["a.h5", "A.x3p", "b"]
    assert _names([scan("x/a.h5"), scan("y/a.h5")]) == ["x_a.h5", "y_a.h5"]
    assert _names([scan("a.h5", 3), scan("a.h5", 40)]) == ["a.h5_3N", "a.h5_40N"]
    alike = [scan("a.h5", group="l"), scan("a.h5", group="r"), scan("a.h5", mate=Path("b.h5"))]
    names = _names(alike)
    assert names == ["a.h5_l", "a.h5_r", "a.h5_b"]
    assert len(set(names)) == 3
    b, c = Path("x/b.h5"), Path("x/c.h5")
    assert _names([scan("a.h5"), scan("a.h5", mate=b), scan("a.h5", mate=c)]) == [
        "a.h5",
        "a.h5_b",
        "a.h5_c",
    ]
    assert _names([scan("a.h5", 3, mate=b), scan("a.h5", 40, mate=b), scan("a.h5", 3)]) == [
        "a.h5_b_3N",
        "a.h5_b_40N",
        "a.h5",
    ]


def test_what_a_list_says_of_a_scan_names_its_results_as_far_as_it_tells_them_apart():
    both = [scan("a.h5", N, group) for N in (3, 40) for group in ("joint 7", "a/b", None)]
    ends = "_joint 7", "_a_b", ""
    assert _names(both) == [f"a.h5_{N}N{end}" for N in (3, 40) for end in ends]
    um, nm, cut, deeper = (
        Scan(Path("a.csv"), load_settings(overrides=(f"{name}={value}",)))
        for name, value in (
            *(("reading.unit", "um"), ("reading.unit", "nm")),
            *(("hills.material_ratio", 0.2), ("hills.material_ratio", 0.3)),
        )
    )
    assert _names([um, nm, scan("a.csv")]) == ["a.csv_um", "a.csv_nm", "a.csv"]
    grouped = [replace(um, group="l"), replace(um, group="r"), nm]
    assert _names(grouped) == ["a.csv_l", "a.csv_r", "a.csv"]
    assert _names([cut, deeper]) == [f"a.csv_{one.digest}" for one in (cut, deeper)]


@pytest.mark.usefixtures("here")
def test_each_scan_has_its_own_name_and_they_are_in_the_order_of_their_paths():
    files("in/b.h5", "in/a.h5", "in/a.x3p")
    scans, _ = find_scans(["in/b.h5", "in"], SETTINGS)
    assert [(one.path.name, one.name) for one in scans] == [
        ("a.h5", "a.h5"),
        ("a.x3p", "a.x3p"),
        ("b.h5", "b"),
    ]


@pytest.mark.usefixtures("here")
def test_a_scan_that_is_reached_by_two_ways_is_one(here):
    files("in/a.h5", "in/b.h5")
    Path("far").mkdir()
    Path("far/way").symlink_to("../in")
    Path("in/same.h5").symlink_to("a.h5")  # a name of its own, as in a store of data
    once = ["in/a.h5", "in/b.h5", "in/same.h5"]
    assert found("in", "in/../in/a.h5", "far/way", f"{here}/far/way/../in/b.h5") == (once, {})
    (here / "a.csv").write_text("scan,preload_N\nin/a.h5,\nfar/way/a.h5,7\nin/../in/a.h5,7\n")
    scans, _ = find_scans(["in/a.h5"], SETTINGS, here / "a.csv")
    preloads_N = [one.settings.contact.preload_N for one in scans]
    assert sorted(preloads_N) == [7.0, SETTINGS.contact.preload_N]


def result(home, path, file="summary.json"):
    Path(home).mkdir(parents=True)
    held = {"schema": "capslip/failure/1", "path": str(path)}
    if file == "summary.json":
        held = {"schema": SCHEMA, "surface": {"path": str(path)}}
    (Path(home) / file).write_text(json.dumps(held))


@pytest.mark.parametrize("file", ["summary.json", "failure.json"])
def test_what_has_a_result_keeps_its_name_and_who_comes_takes_a_longer_one(here, file):
    files("in/a.h5", "in/a.csv", "more/a.h5", "in/b.h5", "in/b.csv")
    result("out/scans/a", here / "in/a.h5", file)
    result("out/scans/a.h5", here / "more/a.h5", file)
    result("out/scans/b", here / "elsewhere/b.h5", file)
    scans, _ = find_scans(["in", "more"], SETTINGS, leave_out=Path("out"))
    assert {str(one.path.relative_to(here)): one.name for one in scans} == {
        "in/a.h5": "a",
        "in/a.csv": "a.csv",
        "more/a.h5": "a.h5",
        "in/b.h5": "b.h5",
        "in/b.csv": "b.csv",
    }
    assert {one.name for one in find_scans(["in"], SETTINGS)[0]} == {
        "a.h5",
        "a.csv",
        "b.h5",
        "b.csv",
    }


def test_two_scans_of_one_file_cannot_both_keep_the_name_of_its_result(here):
    files("a.h5")
    (here / "a.csv").write_text("scan,preload_N\na.h5,3\na.h5,40\n")
    result("out/scans/a", here / "a.h5")
    scans, _ = find_scans((), SETTINGS, here / "a.csv", leave_out=Path("out"))
    assert sorted(one.name for one in scans) == ["a.h5_3N", "a.h5_40N"]


def test_a_name_is_one_that_any_system_takes():
    assert _plain('a<b>c:d"e/f\\g|h?i*j\nk') == "a_b_c_d_e_f_g_h_i_j_k"
    assert (_plain(".bashrc"), _plain("a.b"), _plain("µ b")) == ("_bashrc", "a.b", "µ b")
    whole = "é" * (MOST_BYTES // 2)
    assert _plain(whole) == whole
    long, other = _plain(whole + "a"), _plain(whole + "b")
    assert long != other
    for name in (long, other):
        stem, _, digest = name.rpartition("_")
        assert (stem, len(digest)) == (whole, 8)
