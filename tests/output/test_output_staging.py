"""The way of a result into its folder: at every point where it may end, old or new, and whole."""

import errno
import json
import os
import threading
from contextlib import contextmanager
from itertools import count
from pathlib import Path

import pytest

from capslip.errors import OutputError
from capslip.output import staging
from capslip.output.staging import is_whole, locked, new_folder, read_summary, recover
from capslip.summary import SCHEMA

OLD = {"caps.csv": "old", "jenkins.csv": "old", "settings.toml": "old", "figures/a.png": "old"}
NEW = {"caps.csv": "new", "settings.toml": "new", "figures/b.png": "new", "surface.vtu": "new"}


def fill(work, files):
    for name, text in files.items():
        (work / name).parent.mkdir(exist_ok=True)
        (work / name).write_text(text)
    summary = staging.with_digests({"schema": SCHEMA}, work)
    (work / "summary.json").write_bytes(staging.summary_text(summary))


def result(folder, files):
    with new_folder(folder) as work:
        fill(work, files)
    return folder


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_text()
        for path in folder.rglob("*")
        if path.is_file() and path.name != "summary.json"
    }


@contextmanager
def every_step(step):
    """Call `step` before each call that changes the disk."""
    calls = [(os, "replace"), (os, "fsync"), (os, "mkdir"), (os, "unlink"), (os, "rmdir")]
    before = {name: getattr(place, name) for place, name in calls}

    def counted(name):
        def call(*arguments, **options):
            step()
            return before[name](*arguments, **options)

        return call

    for place, name in calls:
        setattr(place, name, counted(name))
    try:
        yield
    finally:
        for place, name in calls:
            setattr(place, name, before[name])


def new_result(folder):
    return result(folder, NEW)


def failure(folder):
    with new_folder(folder) as work:
        (work / "failure.json").write_text('{"schema": "capslip/failure/1"}')
    return folder


def write_and_die(folder, at, write=new_result):
    """Replace a result in a process that ends, as by a signal, at one of its steps."""
    pid = os.fork()
    if pid == 0:
        steps = count()

        def step():
            if next(steps) == at:
                os._exit(9)

        try:
            with every_step(step):
                write(folder)
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 9


@pytest.mark.long
def test_wherever_a_process_ends_the_folder_is_old_or_new_and_whole(tmp_path):
    seen = []
    for at in count():
        folder = result(tmp_path / str(at), OLD)
        died = write_and_die(folder, at)
        summary = read_summary(folder)
        assert summary is None or is_whole(summary, folder), at
        with locked(folder):
            recover(folder)
        assert is_whole(read_summary(folder), folder), at
        assert contents(folder) in (OLD, NEW), at
        seen.append(contents(folder) == NEW)
        assert not list(folder.rglob(".capslip*")), at
        if not died:
            break
    assert len(seen) > 20
    assert seen == sorted(seen)  # once it is the new one, it stays so
    assert {True, False} == set(seen)


@pytest.mark.long
@pytest.mark.parametrize("before", [new_result, failure])
def test_wherever_a_process_ends_a_failure_is_beside_no_result(tmp_path, before):
    """Whichever of both takes the place of the other; and files of someone else stay."""
    after = failure if before is new_result else new_result
    ways = [{*NEW, "summary.json"}, {"failure.json"}]
    old, new = ways if before is new_result else ways[::-1]
    seen = []
    for at in count():
        folder = before(tmp_path / str(at))
        died = write_and_die(folder, at, after)
        assert len({"summary.json", "failure.json"} & set(os.listdir(folder))) <= 1, at
        summary = read_summary(folder)
        assert summary is None or is_whole(summary, folder), at
        (folder / "thesis.tex").write_text("years")
        with locked(folder):
            recover(folder)
        (folder / "thesis.tex").unlink()
        found = {one.relative_to(folder).as_posix() for one in folder.rglob("*") if one.is_file()}
        assert found in (old, new), at
        assert (folder / "figures").exists() == ("figures/b.png" in found), at
        seen.append(found == new)
        if not died:
            break
    assert len(seen) > 10
    assert seen == sorted(seen)
    assert {True, False} == set(seen)


def test_a_failure_takes_no_place_beside_files_of_someone_else(tmp_path):
    folder = result(tmp_path / "a", OLD)
    (folder / "thesis.tex").write_text("years")
    with pytest.raises(OutputError, match=r"thesis\.tex"):
        failure(folder)
    assert contents(folder) == OLD | {"thesis.tex": "years"}


def test_a_failure_removes_no_summary_that_is_not_ours(tmp_path):
    with new_folder(tmp_path / "a") as work:
        (work / "failure.json").write_text("torn")
        (tmp_path / "a" / "summary.json").write_text("mine")
    assert contents(tmp_path / "a") == {"failure.json": "torn"}
    assert (tmp_path / "a" / "summary.json").read_text() == "mine"


def test_the_next_result_finds_a_folder_that_was_left_in_between(tmp_path):
    folder = result(tmp_path / "a", OLD)
    assert write_and_die(folder, 15)
    result(folder, OLD)
    assert contents(folder) == OLD


def test_all_of_a_result_is_on_the_disk_before_it_takes_its_place(tmp_path, monkeypatch):
    sync, move, calls = os.fsync, os.replace, []

    def synced(number):
        calls.append(("sync", Path(os.readlink(f"/proc/self/fd/{number}")).name))
        sync(number)

    def moved(source, place):
        calls.append(("move", Path(place).name))
        move(source, place)

    result(tmp_path / "a", OLD)
    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", moved)
    result(tmp_path / "a", NEW)
    ready = calls.index(("move", staging.READY))
    names = {name for what, name in calls[:ready] if what == "sync"}
    files = {"caps.csv", "settings.toml", "b.png", "surface.vtu", "figures", "summary.json"}
    assert names > files | {staging.GONE}
    assert any(name.startswith(staging.OURS) for name in names)  # the folder that was renamed
    last = calls.index(("move", "summary.json"))
    after = calls[last - 2 : last] + calls[last + 1 :]
    assert after == [("sync", "figures"), ("sync", "a"), ("sync", "a")]


def write_beside(folder, happens):
    """Write a result while something else happens."""
    with new_folder(folder) as work:
        fill(work, NEW)
        happens()


def fails():
    raise ValueError("torn")


def test_an_error_before_the_result_is_whole_leaves_the_earlier_one(tmp_path):
    folder = result(tmp_path / "a", OLD)
    with pytest.raises(ValueError, match="torn"):
        write_beside(folder, fails)
    assert contents(folder) == OLD
    assert not list(folder.rglob(".capslip*"))


def test_hardly_any_room_is_told_and_nothing_is_left(tmp_path, monkeypatch):
    staging.check_room(tmp_path)
    write = Path.write_bytes

    def full(path, data):
        write(path, data[:10])
        raise OSError(errno.EDQUOT, "Disk quota exceeded")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="quota") as told:
        staging.check_room(tmp_path)
    assert staging.is_full(told.value)
    assert not staging.is_full(OSError(errno.EIO, "torn"))
    assert not staging.is_full(OSError("full"))
    assert not staging.is_full(ValueError(errno.ENOSPC))
    assert not list(tmp_path.iterdir())


def test_what_others_put_there_meanwhile_stays(tmp_path):
    folder = tmp_path / "a"
    with new_folder(folder) as work:
        fill(work, NEW)
        (folder / "thesis.tex").write_text("years")
    assert contents(folder) == NEW | {"thesis.tex": "years"}
    with pytest.raises(OutputError, match=r"thesis\.tex"):
        result(folder, OLD)


@pytest.mark.parametrize("name", ["caps.csv", "figures", "figures/b.png"])
def test_a_file_of_a_name_that_is_needed_is_not_replaced(tmp_path, name):
    folder = tmp_path / "a"

    def appears():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("mine")

    with pytest.raises(OutputError, match="appeared"):
        write_beside(folder, appears)
    assert contents(folder) == {name: "mine"}


def test_a_picture_of_someone_else_among_ours_is_not_replaced(tmp_path):
    folder = result(tmp_path / "a", OLD)
    (folder / "figures" / "mine.png").write_text("mine")
    with pytest.raises(OutputError, match=r"figures/mine\.png"):
        result(folder, NEW)
    assert contents(folder) == OLD | {"figures/mine.png": "mine"}


LEFT = (".DS_Store", "Thumbs.db", ".~lock.caps.csv#", "~$caps.xlsx", "figures/.DS_Store")


def test_leftovers_of_file_managers_stay_and_stand_in_no_way(tmp_path):
    folder = result(tmp_path / "a", OLD)
    left = dict.fromkeys(LEFT, "left")
    for name, text in left.items():
        (folder / name).write_text(text)
    assert contents(result(folder, NEW)) == NEW | left
    assert contents(result(folder, {"settings.toml": "new"})) == {"settings.toml": "new"} | left
    assert is_whole(read_summary(folder), folder)
    result(folder, OLD)
    (folder / "summary.json").write_bytes(b"")  # which listed what is ours
    assert contents(failure(folder)) == {"failure.json": '{"schema": "capslip/failure/1"}'} | left


def test_leftovers_make_no_file_beside_them_ours(tmp_path):
    folder = result(tmp_path / "a", OLD)
    (folder / "figures" / ".DS_Store").touch()
    (folder / "figures" / ".Mine").touch()
    with pytest.raises(OutputError, match=r"figures/\.Mine"):
        result(folder, NEW)


def test_a_link_to_a_folder_is_followed_and_stays_one(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "there")
    for files in (OLD, NEW):
        result(tmp_path / "link", files)
        assert (tmp_path / "link").is_symlink()
        assert contents(tmp_path / "there") == files


def test_a_folder_keeps_its_identity_and_gets_the_rights_of_others(tmp_path):
    (tmp_path / "plain").mkdir()
    result(tmp_path / "a", OLD)
    before = (tmp_path / "a").stat()
    assert before.st_mode == (tmp_path / "plain").stat().st_mode
    result(tmp_path / "a", NEW)
    assert (tmp_path / "a").stat().st_ino == before.st_ino


def test_two_processes_do_not_write_one_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(staging, "WAIT_S", 0.1)
    folder, inside, go_on = tmp_path / "a", threading.Event(), threading.Event()

    def first():
        with new_folder(folder) as work:
            inside.set()
            go_on.wait(10)
            fill(work, OLD)

    thread = threading.Thread(target=first)
    thread.start()
    inside.wait(10)
    with pytest.raises(OutputError, match="another run"), locked(folder, wait_s=0.1):
        pass
    go_on.set()
    result(folder, NEW)  # waits
    thread.join()
    assert contents(folder) in (OLD, NEW)
    assert not list(folder.rglob(".capslip*"))


def test_a_torn_summary_is_replaced_and_a_foreign_one_is_not(tmp_path):
    folder = result(tmp_path / "a", OLD)
    (folder / "summary.json").write_bytes(b"")
    assert contents(result(folder, NEW)) == NEW
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "summary.json").write_text('{"of": "someone else"}')
    with pytest.raises(OutputError, match="no earlier result"):
        result(tmp_path / "b", NEW)


@pytest.mark.parametrize("change", ["edited", "truncated", "removed", "summary"])
def test_an_edited_result_is_not_whole(tmp_path, change):
    folder = result(tmp_path / "a", OLD)
    assert is_whole(read_summary(folder), folder)
    if change == "summary":
        summary = json.loads((folder / "summary.json").read_text())
        (folder / "summary.json").write_text(json.dumps(summary | {"verdict": "fine"}))
    elif change == "removed":
        (folder / "figures" / "a.png").unlink()
    else:
        (folder / "caps.csv").write_text({"edited": "odd", "truncated": ""}[change])
    assert not is_whole(read_summary(folder), folder)


def test_a_folder_that_cannot_be_written_is_named_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)
    with pytest.raises(OutputError, match="cannot be written"):
        staging.check_folder(tmp_path / "new" / "deep")
    with pytest.raises(OutputError, match="File name too long"):
        staging.check_folder(tmp_path / ("x" * 300))


def test_a_scan_in_the_folder_of_its_result_is_refused_and_one_elsewhere_is_not(tmp_path):
    folder = result(tmp_path / "a", OLD)
    for name in ("scan.h5", "deep/scan.h5", "caps.csv"):
        with pytest.raises(OutputError, match=f"holds .*{name}, which is to be read"):
            staging.check_folder(folder, keep=(None, tmp_path / "elsewhere.h5", folder / name))
    staging.check_folder(folder, keep=(None, tmp_path / "elsewhere.h5"))
    staging.check_folder(tmp_path / "new", keep=(tmp_path / "new" / "scan.h5",))  # not there yet


def test_a_folder_of_the_earlier_result_goes_with_its_last_file_and_no_other(tmp_path):
    folder = result(tmp_path / "a", OLD | {"extra/a.txt": "old"})
    (folder / "drafts").mkdir()  # of someone else, and empty
    result(folder, {"settings.toml": "new"})
    assert contents(folder) == {"settings.toml": "new"}
    assert {entry.name for entry in folder.iterdir()} == {"drafts", "settings.toml", "summary.json"}


def test_a_link_in_a_result_is_a_file_of_it(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "mine").touch()
    work = tmp_path / "work"
    (work / "figures").mkdir(parents=True)
    (work / "figures" / "a.png").touch()
    (work / "link").symlink_to(tmp_path / "there")
    found = [("figures", True), ("figures/a.png", False), ("link", False)]
    assert list(staging._below(work)) == found
