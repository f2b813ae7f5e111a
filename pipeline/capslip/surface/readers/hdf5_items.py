"""What lies in an HDF5 file, without leaving it.

Links to other files, storage in other files and virtual datasets make the library read whatever
file they name: they are refused. Names are looked for in a bounded part of the file.
"""

from collections import deque
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from capslip.errors import UnreadableFileError

MAX_LINKS = 64  # soft links and groups on the way to one dataset
MAX_ITEMS = 2000  # looked at for the list of datasets in a message
MAX_DEPTH = 12


def item_of(file: Any, name: str, what: str) -> Any:
    """Return the group or dataset of a name, or None; never one of another file.

    Raises
    ------
    UnreadableFileError
        If the way to it leaves the file, or is longer than `MAX_LINKS`.
    """
    import h5py

    here = file["/"]
    ahead = [part for part in reversed(name.split("/")) if part]
    for _ in range(MAX_LINKS):
        if not ahead:
            return here
        part = ahead.pop()
        if not isinstance(here, h5py.Group):
            return None
        link = here.get(part, getlink=True)
        if link is None:
            return None
        if isinstance(link, h5py.ExternalLink):
            raise UnreadableFileError(
                f"{what}: {part!r} is a link to another file ({link.filename}); expected data in "
                "this one; copy them into it"
            )
        if isinstance(link, h5py.SoftLink):
            if link.path.startswith("/"):
                here = file["/"]
            ahead += [step for step in reversed(link.path.split("/")) if step]
        else:
            here = here[part]
    raise UnreadableFileError(
        f"{what}: more than {MAX_LINKS} groups and links on the way to a dataset; expected fewer; "
        "export it again"
    )


def check_inside(dataset: Any, what: str) -> None:
    """Refuse a dataset whose numbers lie in other files (UnreadableFileError)."""
    if dataset.is_virtual:
        kind = "is virtual: its numbers lie in other datasets"
    elif dataset.external:
        kind = f"has its numbers in another file ({dataset.external[0][0]})"
    else:
        return
    raise UnreadableFileError(
        f"{what}: the dataset {kind}; expected them in this file; copy the dataset into it"
    )


def names_of_maps(file: Any) -> list[str]:
    """Return the names of datasets with two axes, as far as a bounded look finds them."""
    import h5py

    return [
        name
        for name, link, item in _items(file)
        if isinstance(link, h5py.HardLink) and isinstance(item, h5py.Dataset) and item.ndim == 2
    ]


def check_file(path: Path) -> None:
    """Refuse a file any item of which leaves it, for readers that follow every link.

    Raises
    ------
    UnreadableFileError
        If it does, is damaged, or holds more than `MAX_ITEMS`.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            for number, (name, link, item) in enumerate(_items(file, MAX_ITEMS + 1)):
                if isinstance(link, h5py.ExternalLink) or number == MAX_ITEMS:
                    raise UnreadableFileError(
                        f"{path}: {name!r} is a link to another file, or one of more than "
                        f"{MAX_ITEMS} items; expected data in this file; copy them into it"
                    )
                if isinstance(item, h5py.Dataset):
                    check_inside(item, f"{path}:{name}")
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise UnreadableFileError(
            f"{path}: damaged or truncated HDF5 file ({error}); expected a whole one; copy or "
            "export it again"
        ) from error


def _items(file: Any, most: int = MAX_ITEMS) -> Iterator[tuple[str, Any, Any]]:
    """Yield name, link and item of groups and datasets, of the nearest first."""
    import h5py

    ahead = deque([("", file["/"], 0)])
    n_seen = 0
    while ahead:
        prefix, group, depth = ahead.popleft()
        for name in islice(group, most):
            n_seen += 1
            if n_seen > most:
                return
            link = group.get(name, getlink=True)
            item = group[name] if isinstance(link, h5py.HardLink) else None
            yield prefix + name, link, item
            if isinstance(item, h5py.Group) and depth < MAX_DEPTH:
                ahead.append((f"{prefix}{name}/", item, depth + 1))
