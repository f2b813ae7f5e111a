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


def even_lines(n: int, every: int) -> slice:
    """Return about every so many of n rows or columns, or more; a mirrored map has the same.

    Examples
    --------
    >>> [list(range(n))[even_lines(n, 3)] for n in (10, 11)]
    [[0, 3, 6, 9], [2, 5, 8]]
    """
    step = max(1, min(every, n - 1))
    step -= n % 2 == 0 and step % 2 == 0  # an even number of lines has none in its middle
    count = (n - 1) // step + 1
    count -= step % 2 == 1 and (n - count) % 2 == 1
    first = (n - 1 - (count - 1) * step) // 2
    return slice(first, first + (count - 1) * step + 1, step)
