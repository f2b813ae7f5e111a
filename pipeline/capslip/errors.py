"""The errors that capslip raises: one tree, each with the exit code it leads to.

A message is one line: what is wrong, where, what was found, what was expected, what to do.
"""

import difflib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

SHOWN = 60  # letters of what was found


class CapslipError(Exception):
    """Base of every error that capslip raises on purpose.

    Examples
    --------
    >>> from capslip import load_surface
    >>> try:
    ...     load_surface("nowhere.x3p")
    ... except CapslipError as error:
    ...     print(error)
    nowhere.x3p: no such file; check the path
    """

    exit_code = 1


class SettingsError(CapslipError):
    """A setting, an option or a model parameter is unknown, of the wrong type or out of bounds."""

    exit_code = 2


class OutputError(CapslipError):
    """The output folder cannot be used, or what is asked for cannot be drawn."""

    exit_code = 2


class NothingToDoError(CapslipError):
    """No input was found."""

    exit_code = 4


class ScanError(CapslipError):
    """A scan could not be read or analysed; other scans may be fine."""

    exit_code = 3


class UnreadableFileError(ScanError):
    """The file is not a height map in a format that is known, or is damaged."""


class UncalibratedError(ScanError):
    """The file holds heights, but not their unit or not the pixel size."""


class UnusableSurfaceError(ScanError):
    """The height map was read, but cannot be analysed (constant, all points non-measured, ...)."""


class ContactError(ScanError):
    """The caps cannot carry the preload within the validity of the contact model."""


class OutOfTimeError(ContactError):
    """A solution was not found within its time limit."""


class TipsOverError(ContactError):
    """The line of action of the preload leaves the hull of what can touch."""


class BothFailError(ContactError):
    """Neither the caps of a face nor its map, which was pressed in their place, carry the preload.

    Attributes
    ----------
    of_caps, of_map : str
        What is wrong with either.
    """

    def __init__(self, of_caps: str, of_map: str) -> None:
        super().__init__(of_caps, of_map)
        self.of_caps, self.of_map = of_caps, of_map

    def __str__(self) -> str:
        """Say both in one line."""
        return f"caps fail, as {cause(self.of_caps)}; so does their map, as {cause(self.of_map)}"


def cause(message: str) -> str:
    """Return what a message says was got and expected, without what to do about it.

    Examples
    --------
    >>> cause("shell: 9 N are more than all bears; expected less than 7 N; check preload and units")
    'shell: 9 N are more than all bears, expected less than 7 N'
    >>> cause("no solution when the time was over; allow more")
    'no solution when the time was over'
    """
    got, *rest = message.split("; ")
    return ", ".join((got, *(one for one in rest if one.startswith("expected"))))


def one_of(words: Iterable[str], got: str) -> str:
    """Say what was expected, and which word was probably meant.

    Examples
    --------
    >>> one_of(("regions", "watershed"), "region")
    'expected one of regions, watershed; did you mean regions?'
    """
    words = tuple(words)
    close = difflib.get_close_matches(got, words, n=1)
    mean = f"; did you mean {close[0]}?" if close else ""
    return f"expected one of {', '.join(words)}{mean}"


def check_kind(
    name: str,
    value: object,
    kind: type | tuple[type, ...],
    expected: str,
    error: type[CapslipError] = SettingsError,
) -> None:
    """Refuse an argument that is of another kind, or of none of several.

    Examples
    --------
    >>> check_kind("settings", {}, str, "the name of a file")
    Traceback (most recent call last):
    capslip.errors.SettingsError: settings: got dict; expected the name of a file
    """
    if not isinstance(value, kind):
        raise error(f"{name}: got {type(value).__name__}; expected {expected}")


def check_text(name: str, value: object) -> None:
    """Refuse an argument that is neither a text nor None.

    Examples
    --------
    >>> check_text("unit", 1e-6)
    Traceback (most recent call last):
    capslip.errors.SettingsError: unit: got float; expected a text, or None
    """
    check_kind(name, value, (str, type(None)), "a text, or None")


def check_call(name: str, value: object) -> None:
    """Refuse an argument that cannot be called.

    Examples
    --------
    >>> check_call("progress", True)
    Traceback (most recent call last):
    capslip.errors.SettingsError: progress: got bool; expected a function
    """
    if not callable(value):
        raise SettingsError(f"{name}: got {type(value).__name__}; expected a function")


def path_of(name: str, value: Any) -> Path:
    """Return the path that an argument is.

    Examples
    --------
    >>> path_of("path", None)
    Traceback (most recent call last):
    capslip.errors.SettingsError: path: got NoneType; expected a path
    """
    try:
        return Path(value)
    except TypeError:
        raise SettingsError(f"{name}: got {type(value).__name__}; expected a path") from None


def truth_of(name: str, value: Any) -> bool:
    """Return whether an argument is true, in the type of NumPy too; a text is neither.

    Examples
    --------
    >>> truth_of("invert", "false")
    Traceback (most recent call last):
    capslip.errors.SettingsError: invert: got str; expected true or false
    """
    plain = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(plain, bool):
        raise SettingsError(f"{name}: got {type(value).__name__}; expected true or false")
    return plain


def texts_of(name: str, values: Any) -> tuple[str, ...]:
    """Return the texts that an argument lists, paths as texts; one text is no list.

    Examples
    --------
    >>> texts_of("overrides", "run.workers=3")
    Traceback (most recent call last):
    capslip.errors.SettingsError: overrides: got str; expected a list of texts
    """
    try:
        listed = None if isinstance(values, str | bytes | dict) else tuple(values)
    except TypeError:
        listed = None
    if listed is None:
        raise SettingsError(f"{name}: got {type(values).__name__}; expected a list of texts")
    for i, one in enumerate(listed):
        check_kind(f"{name}[{i}]", one, (str, Path), "a text")
    return tuple(map(str, listed))


def in_short(text: str) -> str:
    r"""Return what was found on one line, and of a long text its beginning.

    Examples
    --------
    >>> in_short("[[1. 0.]\n [0. 1.]]")
    '[[1. 0.] [0. 1.]]'
    """
    line = " ".join(text.split())
    return line if len(line) <= SHOWN else f"{line[:SHOWN]}..."


def printable(text: str) -> str:
    r"""Return a text on one line, with the escape of every character that does not print.

    Examples
    --------
    >>> printable("a\x1b[2J\nb\udce9 µm")
    'a\\x1b[2J\\nb\\udce9 µm'
    """
    if text.isprintable():
        return text
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode() for one in text
    )


def in_one_line(error: BaseException) -> str:
    """Say what ended the work: a message of capslip as it stands, anything else as internal.

    Examples
    --------
    >>> in_one_line(OutputError("out: is a file")), in_one_line(KeyError("x"))
    ('out: is a file', "internal error: KeyError: 'x'; run again with -v and report it")
    >>> in_one_line(OSError(28, "No space left on device", "out"))
    'out: No space left on device'
    """
    if isinstance(error, MemoryError):
        return "not enough memory for this analysis"
    if isinstance(error, CapslipError):
        return printable(str(error))
    if isinstance(error, OSError) and error.strerror:  # a disk, not a defect of this program
        where = "" if error.filename is None else f"{error.filename}: "
        return printable(f"{where}{error.strerror}")
    text = f"internal error: {type(error).__name__}: {error}; run again with -v and report it"
    return printable(" ".join(text.split()))
