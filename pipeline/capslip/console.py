"""What the commands say: results on stdout, progress and errors on stderr, exit codes.

Names, units and notes come from files of others: what is no printable character is written as its
escape, so that it cannot act on the terminal. Where nobody reads any more (`| head`), or a stream
is closed or full, the work goes on in silence; a full disk that takes the only copy of a result is
an error.
"""

import json
import os
import shutil
import signal
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from capslip.errors import CapslipError, ScanError, SettingsError, in_one_line, printable
from capslip.waiting import LISTENER

if TYPE_CHECKING:
    from capslip.result import JointResult

EXAMPLES = {  # of every command, as its --help shows them
    "analyze": (
        "capslip analyze face.x3p --preload 10kN --material steel --amplitude 0.5um",
        "capslip analyze a.x3p b.x3p --area 12cm2 --preload 10kN",
    ),
    "batch": (
        "capslip batch folder_of_scans -o results/all --workers 2",
        "capslip batch --list scans.csv --timeout 600 --retry-failed",
    ),
    "families": (
        "capslip families --m 5 --n 18 --radius-G 23.8 --radius-P 26.7 --h 2.4e-7 --preload 460",
    ),
    "average": ("capslip average first.x3p second.x3p third.x3p -o face.h5",),
    "inspect": (
        "capslip inspect results/face",
        "capslip inspect results/face --colour load --force 0.4 --screenshot face.png",
    ),
    "export": ("capslip export results/face --to ply",),
    "compare": ("capslip compare results/face --assembly measured.csv --identify",),
    "reproduce": ("capslip reproduce -o results/paper",),
    "bench": ("capslip bench -o results/bench",),
    "chart": ("capslip chart -o results/chart",),
    "limits": ("capslip limits --workers 2 -o results/limits",),
    "init-config": ("capslip init-config my.toml",),
    "formats": ("capslip formats",),
}
EXIT_CODES = (
    ("0", "done; warnings are in the result"),
    ("1", "a part of a result was not made, as on a full disk, or an internal error"),
    ("2", "an option, a setting or the output folder is wrong"),
    ("3", "a scan cannot be read or used, has no answer, or not the --export asked for"),
    ("4", "nothing to do"),
    ("130", "interrupted"),
)


def open_streams() -> None:
    """Open streams that the shell closed (`>&-`), to be written to in vain.

    Their numbers are those of the next files otherwise: what a library says would go into these.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_RDWR)  # the least number that is free: its own
            setattr(sys, name, os.fdopen(null, mode, encoding="utf-8"))


class Terminated(KeyboardInterrupt):
    """Another process asked this one to end."""


class _Failure(click.ClickException):
    """One line on stderr and the exit code that the error stands for."""

    def __init__(self, error: CapslipError, exit_code: int | None = None) -> None:
        super().__init__(printable(str(error)))
        self.exit_code = error.exit_code if exit_code is None else exit_code  # type: ignore[misc]

    def show(self, file: Any = None) -> None:
        _echo(f"error: {self.message}", err=True)


@contextmanager
def _in_one_line(ctx: click.Context) -> Iterator[None]:
    """Say what is wrong with a command line as any other error, without the lines of usage."""
    try:
        yield
    except click.UsageError as error:
        said = " ".join(error.format_message().split()).rstrip(".")
        raise _Failure(SettingsError(f"{said} (see {ctx.command_path} --help)")) from error
    except OSError as error:  # of the help or the version, which are said while words are taken
        lost = _lost(sys.stdout, error)
        if lost is None:
            ctx.exit()
        raise _Failure(CapslipError(in_one_line(lost))) from error


class _Command(click.Command):
    """A command that turns the project's errors into one line; `-v` shows the traceback."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take the words of the command."""
        with _in_one_line(ctx):
            return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        verbose = ctx.params.get("verbose")
        try:
            with _termination():
                return super().invoke(ctx)
        except CapslipError as error:
            if verbose:
                _echo(traceback.format_exc(), err=True)
            raise _Failure(error) from error
        except KeyboardInterrupt as error:  # 128 and the signal's number, as in shells
            code = 143 if isinstance(error, Terminated) else 130
            said = str(error) or "interrupted; of what was running no result was written"
            raise _Failure(CapslipError(said), code) from error
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except Exception as error:
            if verbose:
                _echo(traceback.format_exc(), err=True)
            raise _Failure(CapslipError(in_one_line(error))) from error

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write examples and exit codes below the options."""
        with formatter.section("Examples"):
            for line in EXAMPLES[str(self.name)]:
                formatter.write(f"{'':{formatter.current_indent}}{line}\n")  # unbroken, to copy
        with formatter.section("Exit codes"):
            formatter.write_dl(EXIT_CODES)


class Group(click.Group):
    """A group of such commands."""

    command_class = _Command

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take the words before the command."""
        if not args:  # which shows the help
            return super().parse_args(ctx, args)
        with _in_one_line(ctx):
            return super().parse_args(ctx, args)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Find the command."""
        with _in_one_line(ctx):
            return super().resolve_command(ctx, args)


@contextmanager
def _termination() -> Iterator[None]:
    """Let SIGTERM end the work as Ctrl-C does, so that folders under way and children go."""

    def end(*_: object) -> None:
        raise Terminated

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def print_result(
    numbers: Any, text: str, as_json: bool, quiet: bool, only_copy: bool = False
) -> None:
    """Print a result: as JSON with `--json`, as text for people, or not at all.

    Raises
    ------
    OSError
        If the JSON, or a text of which there is no other copy, finds the disk full.
    """
    if as_json:
        plain = json.dumps(numbers, indent=1, ensure_ascii=False, allow_nan=False, default=float)
        _echo(plain, only_copy=True)  # JSON escapes what is not printable by itself
    elif not quiet:
        say_result(to_width(text), only_copy)


def say_result(text: str, only_copy: bool = False) -> None:
    """Print lines for people on stdout; errors as for `print_result`."""
    _echo("\n".join(printable(line) for line in text.split("\n")), only_copy=only_copy)


def to_width(text: str) -> str:
    """Break lines at the width of a terminal; a pipe gets each line whole."""
    from capslip.output.terminal import wrapped

    return wrapped(text, shutil.get_terminal_size().columns) if sys.stdout.isatty() else text


def _echo(text: str, err: bool = False, only_copy: bool = False) -> None:
    """Print; characters that the stream cannot write are escaped, a lost stream is left alone."""
    stream = sys.stderr if err else sys.stdout
    encoding = getattr(stream, "encoding", None) or "utf-8"
    text = text.encode(encoding, "backslashreplace").decode(encoding)
    try:
        click.echo(text, err=err)
    except OSError as error:
        lost = _lost(stream, error)
        if only_copy and lost is not None:
            raise lost from error


def _lost(stream: Any, error: OSError) -> OSError | None:
    """Leave a lost stream alone, and return what to say of it, None where nobody reads any more."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)
    if isinstance(error, BrokenPipeError):
        return None
    return OSError(error.errno, error.strerror, "stdout")


def ending(printed: "JointResult", summary: dict[str, Any], folder: Path) -> str:
    """Say where all is; what was written may have told more than what was printed before.

    Notes as well: that of an export is all that the terminal says of how good it is.
    """
    from capslip.verdict import reason_of

    lines = ["", f"results    {folder}", f"report     {folder / 'report.html'}"]
    if printed.status != summary["status"]:
        lines.insert(1, f"status     {summary['status']}")
    # Another warning of an export, which is told itself, is only counted there
    if reason_of(printed.verdict) != reason_of(summary["verdict"]):
        lines.insert(1, f"verdict    {summary['verdict']}".replace("µ", "u"))
    before = {problem.code for problem in printed.problems}
    notes = [one for one in summary["problems"] if one["severity"] == "info"]
    lines[1:1] = [
        f"note       {one['code']}: {one['message']}".replace("µ", "u")
        for one in notes
        if one["code"] not in before
    ]
    return "\n".join(lines)


class Progress:
    """Messages on stderr, each with the seconds since the start; silent with `-q`.

    On a terminal it also tells how far long calculations are.
    """

    def __init__(self, quiet: bool, verbose: bool = False) -> None:
        self.quiet, self.verbose = quiet, verbose
        self.started = time.perf_counter()
        self.failures: list[tuple[str, Exception]] = []
        LISTENER.set(self if not quiet and sys.stderr.isatty() else None)

    def __call__(self, message: str) -> None:
        """Tell what is done next."""
        if not self.quiet:
            _echo(f"[{self.elapsed_s():5.1f} s] {printable(message)}", err=True)

    def elapsed_s(self) -> float:
        """Return the seconds since the command began."""
        return time.perf_counter() - self.started

    def warn(self, message: str) -> None:
        """Tell what is wrong, even with `-q`."""
        _echo(f"warning: {printable(message)}", err=True)

    def missing(self, message: str, error: Exception | None) -> None:
        """Tell what could not be made; an exception ends the command once all is written."""
        if error is not None:
            self.failures.append((message, error))
            if self.verbose:
                _echo("".join(traceback.format_exception(error)), err=True)
        self.warn(message)

    def raise_failures(self, folder: Path) -> None:
        """End with the first part of what was written that could not be made, if there is one."""
        if not self.failures:
            return
        text = f"{self.failures[0][0]}; all numbers are in {folder}"
        if all(isinstance(error, CapslipError) for _, error in self.failures):
            raise ScanError(text)
        from capslip.disk import is_full

        of_full = [said for said, error in self.failures if is_full(error)]
        if all(isinstance(error, CapslipError) or is_full(error) for _, error in self.failures):
            raise CapslipError(f"{of_full[0]}; all numbers are in {folder}; then run this again")
        raise CapslipError(f"internal error: {text}; run again with -v and report it")
