"""Rows of a map that are looked at together."""

from collections.abc import Iterator

BLOCK_POINTS = 80_000  # what is computed of so many stays in the cache


def row_blocks(shape: tuple[int, ...]) -> Iterator[slice]:
    """Yield the rows of a map, some at a time.

    Examples
    --------
    >>> list(row_blocks((15, 8000)))
    [slice(0, 10, None), slice(10, 15, None)]
    """
    n_rows = max(1, BLOCK_POINTS // shape[1])
    for first in range(0, shape[0], n_rows):
        yield slice(first, min(first + n_rows, shape[0]))
