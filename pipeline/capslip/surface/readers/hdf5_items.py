"""What lies in an HDF5 file, without leaving it.

Links to other files, storage in other files and virtual datasets make the library read whatever
file they name: they are refused. Names are looked for in a bounded part of the file.
"""

from itertools import islice
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

    found: list[str] = []
    ahead = [("", file["/"], 0)]
    n_seen = 0
    while ahead:
        prefix, group, depth = ahead.pop(0)
        for name in islice(group, MAX_ITEMS):
            n_seen += 1
            if n_seen > MAX_ITEMS:
                return found
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                continue
            item = group[name]
            if isinstance(item, h5py.Dataset) and item.ndim == 2:
                found.append(prefix + name)
            elif isinstance(item, h5py.Group) and depth < MAX_DEPTH:
                ahead.append((f"{prefix}{name}/", item, depth + 1))
    return found
