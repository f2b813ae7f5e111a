"""What is wrong with nested dictionaries that shall be a tree of structs, said in one line.

The line names the key, what was found there and what is expected.
"""

import difflib
import sys
from collections.abc import Iterable
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any, TypeVar, get_args

import msgspec

from capslip.errors import SettingsError, in_short, one_of
from capslip.units import KNOWN, unit_of

T = TypeVar("T", bound=msgspec.Struct)

LEAST, GREATEST = 1e-30, 1e30  # of any positive setting, in SI: beyond it powers overflow
# What msgspec calls types, in words; null is a key that is left out
IN_WORDS = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "str": "a text",
    "array": "a list, [a, b]",
}


def plain(value: Any, where: str, path: tuple[str, ...] = ()) -> Any:
    """Return a value without structs, types of NumPy and paths; refuse what JSON cannot hold.

    Parameters
    ----------
    value : any
        Structs become dictionaries of what is not None in them.
    where : str
        What the message begins with.
    path : tuple of str
        Names of the tables around it.

    Raises
    ------
    SettingsError
        If a number is not finite, or greater than any float, or a text is no UTF-8.
    """
    if isinstance(value, msgspec.Struct):
        pairs = ((name, getattr(value, name)) for name in value.__struct_fields__)
        value = {name: inner for name, inner in pairs if inner is not None}
    if isinstance(value, dict):
        named = {str(key): inner for key, inner in value.items()}
        return {key: plain(inner, where, (*path, key)) for key, inner in named.items()}
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, list | tuple):
        return [plain(inner, where, path) for inner in value]
    if isinstance(value, float | int) and not abs(value) <= sys.float_info.max:
        got = value if isinstance(value, float) else "a whole number of more than 308 digits"
        raise SettingsError(f"{where}: {'.'.join(path)}: got {got}; expected a finite number")
    value = str(value) if isinstance(value, Path) else value
    if isinstance(value, str):
        try:
            value.encode()
        except UnicodeEncodeError:
            got = f"{where}: {'.'.join(path)}: got {value!r}"
            raise SettingsError(f"{got}; expected a text; write it in UTF-8") from None
    return value


def refuse_unknown(tables: dict[str, Any], root: type[msgspec.Struct], where: str) -> None:
    """Raise a SettingsError where a key is none of the structs, with a proposal for a misspelt one.

    Parameters
    ----------
    tables : dict
        Nested dictionaries, as `plain` returns them.
    root : type
        The struct that they shall be.
    where : str
        What the message begins with.
    """
    _refuse_unknown(tables, root, root, where, ())


def _refuse_unknown(
    tables: dict[str, Any],
    kind: type[msgspec.Struct],
    root: type[msgspec.Struct],
    where: str,
    path: tuple[str, ...],
) -> None:
    known = _types(kind)
    for key, value in tables.items():
        if key not in known:
            raise SettingsError(
                f"{where}: unknown setting {'.'.join((*path, key))}"
                f"{meant(key, root, tuple(known), path)} (known here: {', '.join(known)})"
            )
        nested = known[key]
        if isinstance(nested, type) and issubclass(nested, msgspec.Struct):
            if not isinstance(value, dict):
                raise SettingsError(f"{where}: {'.'.join((*path, key))}: expected a table of keys")
            _refuse_unknown(value, nested, root, where, (*path, key))


def meant(
    key: str,
    root: type[msgspec.Struct],
    known: tuple[str, ...] = (),
    path: tuple[str, ...] = (),
) -> str:
    """Return a proposal for an unknown name: one of its table, or one of another.

    Parameters
    ----------
    key : str
        The name that nothing has.
    root : type
        The struct of all tables.
    known : tuple of str
        The names of its table.
    path : tuple of str
        The name of its table, and of those around it.
    """
    close = [one for one in known if one.startswith(f"{key}_")]
    close = close or difflib.get_close_matches(key, known, n=1)
    names = [".".join((*path, one)) for one in close]
    names = names or [
        name for name in _names(root) if f"{name.rpartition('.')[2]}_".startswith(f"{key}_")
    ]
    return f"; did you mean {' or '.join(names)}?" if names else ""


def converted(tables: dict[str, Any], root: type[T], where: str) -> T:
    """Make nested dictionaries a struct; a wrong type, or a value out of bounds: SettingsError."""
    try:
        return msgspec.convert(tables, root)
    except msgspec.ValidationError as error:
        raise SettingsError(f"{where}: {_explain(str(error), tables, root)}") from error


def changed(settings: msgspec.Struct, wanted: Iterable[str]) -> list[str]:
    """Return the names of settings that have another value than their default.

    Parameters
    ----------
    settings : Struct
        All tables.
    wanted : iterable of str
        Names of settings, or of tables, for all that they hold.
    """
    root = type(settings)
    begins = tuple(f"{name}." for name in wanted)
    default = root()
    return [
        name
        for name in _names(root)
        if f"{name}.".startswith(begins) and attrgetter(name)(settings) != attrgetter(name)(default)
    ]


@cache  # hints are evaluated anew each time that msgspec is asked
def _types(kind: type[msgspec.Struct]) -> dict[str, Any]:
    """Return the types of the fields of a struct."""
    return {field.name: field.type for field in msgspec.structs.fields(kind)}


@cache
def _names(kind: type[msgspec.Struct]) -> tuple[str, ...]:
    """Return every setting of a table and of the tables in it, with the names of its tables."""
    found = list[str]()
    for name, nested in _types(kind).items():
        if isinstance(nested, type) and issubclass(nested, msgspec.Struct):
            found += [f"{name}.{inner}" for inner in _names(nested)]
        else:
            found.append(name)
    return tuple(found)


def _explain(message: str, tables: dict[str, Any], root: type[msgspec.Struct]) -> str:
    """Turn msgspec's message into key, value found, value expected."""
    expected, _, path = message.partition(" - at `$.")
    keys = path.rstrip("`").split(".")
    value: Any = tables
    kind: Any = root
    for key in keys:
        name, _, index = key.partition("[")
        value = value.get(name) if isinstance(value, dict) else value
        if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
            kind = _types(kind)[name]
        if index and isinstance(value, list):
            value = value[int(index.rstrip("]"))] if index[0].isdigit() else value
    literals = [arg for part in (kind, *get_args(kind)) for arg in get_args(part)]
    choices = [str(one) for one in dict.fromkeys(literals) if isinstance(one, str | int)]
    types, _, bounds = expected.removeprefix("Expected `").partition("`")
    words = " or ".join(IN_WORDS[one] for one in types.split(" | ") if one in IN_WORDS)
    if isinstance(value, float | int) and value <= 0.0:
        bounds = bounds.replace(f">= {LEAST}", "> 0")
    expected = f"expected {words}{bounds.partition(', got')[0]}"
    expected = one_of(choices, str(value)) if choices else expected
    unit = unit_of(keys[-1].partition("[")[0])
    if unit is not None and isinstance(value, str):
        known, example = KNOWN[unit]
        expected += f" in {unit}, or one and its unit ({', '.join(known)}), as in {example}"
    return f"{'.'.join(keys)}: got {in_short(repr(value))}; {expected}"
