"""What an analysis can be written as for another program, one file in `output/exports` each.

Each holds an `Export` named `EXPORT` under the file's own name.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from capslip import registry
from capslip.errors import SettingsError, one_of

if TYPE_CHECKING:
    from capslip.result import JointResult

FOLDER = "output.exports"


@dataclass(frozen=True)
class Export:
    """One way to write the joint for another program."""

    files: tuple[str, ...]  # in the folder of the result
    write: Callable[["JointResult", Path], None]  # of one scan or of several


def export_named(name: str) -> Export:
    """Return the export of that name; SettingsError where there is none."""
    known = registry.names(FOLDER)
    if name not in known:
        raise SettingsError(f"export: got {name}; {one_of(known, name)}")
    return cast(Export, registry.entry(FOLDER, name).EXPORT)
