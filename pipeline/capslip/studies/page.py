"""What every study writes: tables in Markdown, and the files of its folder."""

import errno
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from operator import methodcaller
from pathlib import Path
from typing import TYPE_CHECKING, Any

from capslip.disk import way_out, write_whole
from capslip.errors import OutputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = dict[str, Any]  # of results, as JSON holds them


def table(head: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return a table in Markdown.

    Examples
    --------
    >>> print(table(("cap", "R [m]"), [(1, 23.8)]))
    | cap | R [m] |
    | --- | --- |
    | 1 | 23.8 |
    """
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def png(figure: "Figure") -> bytes:
    """Return a picture as the bytes of its file."""
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def write(folder: str | Path, files: Mapping[str, str | bytes]) -> None:
    """Write texts and pictures by the names of their files; the folder is made where absent.

    Raises
    ------
    OutputError
        If the folder cannot be made or written.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        for name, content in files.items():
            data = content.encode() if isinstance(content, str) else content
            write_whole(folder / name, methodcaller("write_bytes", data))
    except OSError as error:
        step = way_out(error, "choose another with --out")
        raise OutputError(f"output folder {folder}: {error.strerror}; {step}") from error
