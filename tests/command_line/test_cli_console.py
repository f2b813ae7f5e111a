"""What reaches the terminal, and what may not reach the interpreter: names are of others."""

import hashlib
import os
import shlex
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from capslip import console
from capslip.cli import main
from capslip.console import EXAMPLES
from capslip.errors import CapslipError
from capslip.output import folder as output_folder
from capslip.output.terminal import wrapped
from capslip.surface import readers

LIGHT = ("--no-render", "--no-figures", "--preload", "0.1")
LIGHT = (*LIGHT, "--set", "contact.alignment=as_levelled")  # one cap balances under no load
TORN = b"\x89HDF\r\n\x1a\n"  # of one format: others are not loaded to look at it


def face(path):
    y, x = np.mgrid[:40, :60]
    with h5py.File(path, "w") as file:
        file["height"] = -((x - 30.0) ** 2 + (y - 20.0) ** 2) * 1e-3
        file["height"].attrs.update(unit="um", pixel_size=[50.0, 50.0], pixel_unit="um")
    return path


def capslip(*arguments, cwd, **options):
    """Call the program in a process of its own, as from a shell in `cwd`."""
    environment = {**os.environ, **options.pop("env", {})}
    command = [sys.executable, *options.pop("flags", ()), "-m", "capslip", *map(str, arguments)]
    return subprocess.run(
        command, cwd=cwd, env=environment, capture_output=True, check=False, timeout=120, **options
    )


@pytest.mark.parametrize("name", sorted(main.commands))
def test_help_shows_commands_that_parse_and_every_exit_code(name):
    said = CliRunner().invoke(main, [name, "--help"], terminal_width=60).output
    assert {line[2:] for line in said.splitlines()} >= set(EXAMPLES[name])
    for line in EXAMPLES[name]:
        program, command, *arguments = line.split()
        assert (program, command) == ("capslip", name)
        main.commands[name].make_context(name, arguments)
    errors = [CapslipError, *CapslipError.__subclasses__()]
    for code in {error.exit_code for error in errors}:
        assert f"\n  {code}  " in said


@pytest.mark.parametrize("name", ["analyze", "batch", "average"])
def test_help_of_dataset_names_what_each_format_calls_its_maps(name):
    said = CliRunner().invoke(main, [name, "--help"], terminal_width=120).output
    (line,) = (line for line in said.splitlines() if "--dataset" in line)
    assert all(word in line for word in ("dataset,", "array", "variable", "channel"))


def test_the_list_of_commands_says_each_in_whole():
    said = CliRunner().invoke(main, ["--help"], terminal_width=78).output
    _, _, listed = said.partition("Commands:\n")
    lines = listed.splitlines()
    assert [line.split()[0] for line in lines] == sorted(main.commands)  # none is broken
    assert not [line for line in lines if line.endswith("...")]


def test_every_result_is_broken_at_the_width_of_a_terminal(monkeypatch, capsys):
    monkeypatch.setattr(console, "to_width", lambda text: wrapped(text, 40))
    console.print_result({}, "compared   24 amplitudes of 0.018 to 0.91 um, model", False, False)
    lines = capsys.readouterr().out.splitlines()
    assert lines == ["compared   24 amplitudes of 0.018 to", "           0.91 um, model"]


@pytest.mark.long
def test_no_module_beside_the_scans_is_run(tmp_path):
    face(tmp_path / "a.h5")
    for name in ("numpy", "pyvista", "msgspec", "random", "tempfile", "pickle", "selectors"):
        (tmp_path / f"{name}.py").write_text("open('ran', 'a').write(__name__); raise SystemExit")
    ran = capslip("analyze", "a.h5", "-o", "out", "--no-figures", *LIGHT[2:], cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    ran = capslip("batch", "a.h5", "-o", "all", *LIGHT, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert not (tmp_path / "ran").exists()


def test_every_module_that_the_makefile_runs_is_run_in_safety():
    makefile = (Path(__file__).parents[2] / "Makefile").read_text()
    assert "python -m" not in makefile
    assert makefile.count("-P -m") > 4
    for name in ("SURFACE", "SCANS", "RESULT"):
        assert f'-- "$({name})"' in makefile


def called(*arguments):
    """Call the program in this process."""
    return CliRunner().invoke(main, list(map(str, arguments)))


@pytest.mark.usefixtures("here")
def test_a_scan_that_is_called_like_an_option(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    face(tmp_path / "--help")
    ran = called("analyze", "-o", "out", *LIGHT, "--", "--help")
    assert ran.exit_code == 0, ran.output
    ran = called("batch", "-o", "all", *LIGHT, "--", "--help")
    assert ran.exit_code == 0, ran.output
    assert (tmp_path / "all" / "scans" / "--help" / "summary.json").is_file()


def test_escapes_and_lines_in_names_do_not_reach_the_terminal(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = "a\x1b]0;mine\x07\nerror: forged.h5"
    face(tmp_path / name)
    ran = called("analyze", name, "-o", "out", *LIGHT)
    assert ran.exit_code == 0, ran.output
    assert b"\x1b" not in ran.stdout_bytes + ran.stderr_bytes
    assert b"\x07" not in ran.stdout_bytes + ran.stderr_bytes
    assert not [line for line in ran.stderr_bytes.splitlines() if line.startswith(b"error: forged")]
    (tmp_path / name).write_bytes(TORN)
    ran = called("analyze", name, "-o", "out", *LIGHT)
    assert ran.exit_code == 3
    assert b"\x1b" not in ran.stderr_bytes
    assert len([line for line in ran.stderr_bytes.splitlines() if line.startswith(b"error")]) == 1


@pytest.mark.long
# Python takes C for C.UTF-8, so that these two are one; ASCII alone is stricter
@pytest.mark.parametrize(
    ("locale", "ways"),
    [("C", [()]), ("C.UTF-8", [("--json",)]), ("latin", [(), ("--json",)])],
)
def test_a_name_of_odd_bytes_in_any_locale(tmp_path, locale, ways):
    name = os.fsdecode(b"caf\xe9 \xc2\xb5.h5")
    face(tmp_path / "plain.h5").rename(tmp_path / name)
    env = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii"}
    env = env if locale == "latin" else {"LC_ALL": locale}
    for flags in ways:
        ran = capslip("analyze", name, "-o", "out", *LIGHT, *flags, cwd=tmp_path, env=env)
        assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "out" / "report.html").is_file()


def test_a_path_that_is_too_long_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ran = called("analyze", "x" * 300)
    assert ran.exit_code == 3, ran.output
    assert "File name too long" in ran.stderr
    assert "internal" not in ran.stderr
    ran = called("analyze", face(tmp_path / "a.h5"), "-o", "y" * 300, *LIGHT)
    assert ran.exit_code == 2
    assert "File name too long" in ran.stderr


def test_a_disk_that_refuses_is_no_internal_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def full(*_):
        raise OSError(28, "No space left on device", "out/result.h5")

    monkeypatch.setattr(output_folder.tables, "write_result", full)
    ran = CliRunner().invoke(main, ["analyze", str(face(tmp_path / "a.h5")), "-o", "out", *LIGHT])
    assert ran.exit_code == 2
    last = ran.stderr.splitlines()[-1]
    assert last == (
        "error: output folder out: No space left on device; nothing was written; make room on its "
        "disk, or choose another with --out"
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_a_closed_pipe_loses_no_result(tmp_path):
    face(tmp_path / "a.h5")
    command = f"{sys.executable} -m capslip analyze a.h5 -o out {' '.join(LIGHT)}"
    ran = subprocess.run(
        ["bash", "-c", f"{command} 2>err | true; exit ${{PIPESTATUS[0]}}"],
        cwd=tmp_path,
        check=False,
        timeout=120,
    )
    assert ran.returncode == 0, (tmp_path / "err").read_text()
    assert "error" not in (tmp_path / "err").read_text()
    assert (tmp_path / "out" / "summary.json").is_file()


def redirected(how, *arguments, cwd):
    """Call the program with streams as a shell redirects them."""
    if "/dev/full" in how and not Path("/dev/full").exists():
        pytest.skip("this system has no disk that is always full")
    command = shlex.join([sys.executable, "-m", "capslip", *map(str, arguments)])
    return subprocess.run(
        ["bash", "-c", f"{command} {how}"], cwd=cwd, capture_output=True, check=False, timeout=120
    )


LOST = (">&-", "2>&-", ">/dev/full", "2>/dev/full", "<&- >&- 2>&-", ">/dev/full 2>&1")


@pytest.mark.long
@pytest.mark.parametrize("how", LOST)
def test_a_stream_that_is_closed_or_full_loses_no_result(tmp_path, how):
    face(tmp_path / "a.h5")
    ran = redirected(how, "analyze", "a.h5", "-o", "out", *LIGHT, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert b"error" not in ran.stderr
    assert (tmp_path / "out" / "report.html").is_file()
    assert (b"verdict" in ran.stdout) == (">" not in how.replace("2>", ""))
    if "2>" in how:  # else what is wrong can be said
        ran = redirected(how, "analyze", "b.h5", "-o", "out", "-v", *LIGHT, cwd=tmp_path)
        assert ran.returncode == 3  # of the work, and not of what could not be said of it


@pytest.mark.long
@pytest.mark.parametrize("how", [">&-", "2>&-", ">/dev/full 2>/dev/full"])
def test_a_batch_goes_on_where_nobody_can_be_told(tmp_path, how):
    face(tmp_path / "a.h5")
    arguments = ("batch", "a.h5", "b.h5", "-o", "all", "--workers", "1", *LIGHT)
    (tmp_path / "b.h5").write_bytes(TORN)
    assert redirected(how, *arguments, cwd=tmp_path).returncode == 3
    assert (tmp_path / "all" / "index.html").is_file()
    assert (tmp_path / "all" / "scans" / "a" / "summary.json").is_file()
    if how.count(">") > 1:  # the more so where one of both can be told
        face(tmp_path / "b.h5")
        assert redirected(how, *arguments, cwd=tmp_path).returncode == 0
        assert (tmp_path / "all" / "scans" / "b" / "summary.json").is_file()


@pytest.mark.long
def test_a_full_disk_is_told_where_it_takes_what_was_asked_for(tmp_path):
    face(tmp_path / "a.h5")
    given = ("families", "--m", "3", "--n", "2", "--radius-G", "24", "--radius-P", "26")
    given += ("--h", "1e-7", "--preload", "100")
    analysis = ("analyze", "a.h5", "-o", "out", "-q", *LIGHT)
    for arguments in ((*analysis, "--json"), given, (*given, "--json"), ("formats",)):
        ran = redirected(">/dev/full", *arguments, cwd=tmp_path)
        assert ran.returncode == 1
        assert ran.stderr == b"error: stdout: No space left on device\n"
    assert (tmp_path / "out" / "summary.json").is_file()
    ran = redirected(">/dev/full", *given, "-o", "given", cwd=tmp_path)  # the folder has it, too
    assert (ran.returncode, ran.stderr) == (0, b"")
    ran = redirected("| true; exit ${PIPESTATUS[0]}", *given, cwd=tmp_path)
    assert (ran.returncode, ran.stderr) == (0, b"")


@pytest.mark.parametrize(
    "arguments", [("--help",), ("--version",), ("analyze", "-h"), ("init-config", "--help")]
)
def test_help_and_version_on_a_full_disk_are_an_error_of_one_line(tmp_path, arguments):
    ran = redirected(">/dev/full", *arguments, cwd=tmp_path)
    assert ran.returncode == 1
    assert ran.stderr == b"error: stdout: No space left on device\n"
    for how in (">&-", "| true; exit ${PIPESTATUS[0]}", ">/dev/full 2>&1"):
        ran = redirected(how, *arguments, cwd=tmp_path)
        assert (ran.returncode, ran.stderr) == (int("full" in how), b"")
    assert not any(tmp_path.iterdir())


def test_no_file_takes_the_number_of_a_closed_stream(tmp_path):
    code = (
        "import sys; from capslip.console import open_streams; open_streams(); "
        "print('lost'); sys.stderr.write('lost'); file = open('kept', 'w'); "
        "sys.exit(file.fileno() if not sys.stdin.read() else 1)"
    )
    for how in ("<&- >&- 2>&-", "2>&-", ">&-", "<&-"):
        command = f"{sys.executable} -c {shlex.quote(code)} {how}"
        ran = subprocess.run(
            ["bash", "-c", command], cwd=tmp_path, check=False, stdin=subprocess.DEVNULL
        )
        assert ran.returncode == 3  # the least that is no stream
    assert (tmp_path / "kept").read_text() == ""


def test_a_scan_that_changes_while_it_is_read_is_refused(tmp_path, monkeypatch):
    path, read = face(tmp_path / "a.h5"), readers.calibrate
    row = next(one for one in readers.FORMATS if one.name == "hdf5")

    def swapped(source, request):
        found = row.read(source, request)
        with path.open("ab") as file:
            file.write(b"more")
        return found

    fake = type(row)(**{**vars(row), "read": swapped})
    monkeypatch.setattr(readers, "FORMATS", (fake,))
    with pytest.raises(readers.UnreadableFileError, match="changed while it was read"):
        readers.load_surface(path)
    assert read is readers.calibrate


def test_a_scan_at_rest_that_changes_is_refused_though_size_and_date_are_the_same(
    tmp_path, monkeypatch
):
    path = face(tmp_path / "a.h5")
    content, long_ago = path.read_bytes(), (1e9, 1e9)
    os.utime(path, long_ago)
    row = next(one for one in readers.FORMATS if one.name == "hdf5")

    def swapped(source, request):
        found = row.read(source, request)
        path.write_bytes(content[::-1])
        os.utime(path, long_ago)
        return found

    fake = type(row)(**{**vars(row), "read": swapped})
    monkeypatch.setattr(readers, "FORMATS", (fake,))
    with pytest.raises(readers.UnreadableFileError, match="changed while it was read"):
        readers.load_surface(path)


@pytest.mark.parametrize("held_bytes", [1 << 25, 0])
@pytest.mark.parametrize(("age_s", "refused"), [(0.0, True), (3600.0, False)])
def test_a_scan_that_was_just_written_is_refused_though_no_time_tells_that_it_changed(
    tmp_path, monkeypatch, age_s, refused, held_bytes
):
    """As one that is written to by way of mapped memory, whatever its size."""
    path = face(tmp_path / "a.h5")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    monkeypatch.setattr(readers, "HELD_BYTES", held_bytes)
    assert readers.load_surface(path).origin.sha256 == digest
    os.utime(path, (time.time() - age_s,) * 2)
    state, row = readers.state_of(path), next(one for one in readers.FORMATS if one.name == "hdf5")
    monkeypatch.setattr(readers, "state_of", lambda _: state)

    def swapped(source, request):
        found, content = row.read(source, request), source.read_bytes()
        source.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
        return found

    fake = type(row)(**{**vars(row), "read": swapped})
    monkeypatch.setattr(readers, "FORMATS", (fake,))
    if refused:
        with pytest.raises(readers.UnreadableFileError, match="changed while it was read"):
            readers.load_surface(path)
    else:
        assert readers.load_surface(path).origin.sha256 == digest


@pytest.mark.long
def test_sigterm_ends_an_analysis_and_leaves_nothing(tmp_path):
    face(tmp_path / "a.h5")
    code = (
        "import os, signal, sys; from capslip.output import tables; from capslip.cli import main\n"
        "tables.write_summary = lambda *_: os.kill(os.getpid(), signal.SIGTERM)\n"
        f"sys.argv[1:] = ['analyze', 'a.h5', '-o', 'out', *{LIGHT!r}]; main()"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, check=False, timeout=60
    )
    assert ran.returncode == 143, ran.stderr
    assert b"interrupted" in ran.stderr
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.h5"]
