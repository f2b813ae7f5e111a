"""Which of several maps in a file is read, and how names of theirs are said."""

from pathlib import Path

from capslip.errors import UnreadableFileError

SHOWN = 12  # names in one message


def unique_names(names: list[str | None]) -> list[str]:
    """Return a name for each map by which it alone can be asked for.

    Examples
    --------
    >>> unique_names(["Height", "Phase", "Height", None])
    ['Height#1', 'Phase', 'Height#2', 'map 4']
    """
    plain = [name or f"map {number}" for number, name in enumerate(names, 1)]
    return [
        name if plain.count(name) == 1 else f"{name}#{plain[: at + 1].count(name)}"
        for at, name in enumerate(plain)
    ]


def choose(dataset: str | None, names: list[str], heights: list[int], path: Path) -> int:
    """Return the index of the map that is asked for, or of the first that holds heights.

    Parameters
    ----------
    dataset : str or None
        Name that the user gave.
    names : list of str
        From `unique_names`, of all maps of the file.
    heights : list of int
        Indices of the maps that may hold heights, the likeliest first.
    path : path
        The file, for errors.

    Raises
    ------
    UnreadableFileError
        If there is no such map, several of this name, or none that holds heights.
    """
    if dataset is None:
        if heights:
            return heights[0]
        raise UnreadableFileError(
            f"{path}: no map of heights among {shown(names)}; expected one in a unit of length; "
            "export the heights"
        )
    if dataset in names:
        return names.index(dataset)
    alike = [name for name in names if name.rpartition("#")[0] == dataset]
    if alike:
        raise UnreadableFileError(
            f"{path}: {len(alike)} channels {dataset!r}; expected one; choose one of "
            f"{shown(alike)} with --dataset"
        )
    raise UnreadableFileError(
        f"{path}: no channel {dataset!r}; expected one of {shown(names)}; correct --dataset"
    )


def note_of_choice(dataset: str | None, names: list[str], heights: list[int]) -> tuple[str, ...]:
    """Say which map was read where nobody chose between several that hold heights."""
    if dataset is not None or len(heights) < 2:
        return ()
    others = [names[index] for index in heights[1:]]
    return (
        f"the map {names[heights[0]]!r} of the file was read, not {shown(others)}; "
        "--dataset chooses",
    )


def shown(names: list[str]) -> str:
    """List names for a message, the first dozen of many.

    Examples
    --------
    >>> shown([]), shown(["z", "q"])
    ('none', 'z, q')
    """
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return (", ".join(names[:SHOWN]) or "none") + more
