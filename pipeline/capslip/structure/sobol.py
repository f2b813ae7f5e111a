"""Points that fill a cube evenly: a Sobol sequence, scrambled.

That of `scipy.stats.qmc.Sobol`, digit by digit; to load that package takes longer than an analysis.
"""

import numpy as np

BITS = 30
# Of each dimension after the first: a primitive polynomial over the integers mod 2, as a binary
# number, and the first direction numbers (Joe and Kuo, SIAM J. Sci. Comput. 30 (2008) 2635)
DIRECTIONS = (
    (0b11, (1,)),
    (0b111, (1, 3)),
    (0b1011, (1, 3, 1)),
    (0b1101, (1, 1, 1)),
    (0b10011, (1, 1, 3, 3)),
    (0b11001, (1, 3, 5, 13)),
    (0b100101, (1, 1, 5, 5, 17)),
    (0b101001, (1, 1, 5, 5, 5)),
    (0b101111, (1, 1, 7, 11, 19)),
    (0b110111, (1, 1, 5, 1, 1)),
    (0b111011, (1, 1, 1, 3, 11)),
    (0b111101, (1, 3, 5, 5, 31)),
    (0b1000011, (1, 3, 3, 9, 7, 49)),
    (0b1011011, (1, 1, 1, 15, 21, 21)),
    (0b1100001, (1, 3, 1, 13, 27, 49)),
)
MOST_DIMENSIONS = 1 + len(DIRECTIONS)


def scrambled_sobol(dimensions: int, log2_points: int) -> np.ndarray:
    """Return 2^log2_points points in the unit cube, shape (points, dimensions).

    Scrambled by lower triangular matrices and a shift (Matousek, J. Complexity 14 (1998) 527), from
    the seed 0.

    Parameters
    ----------
    dimensions : int
        1 to 16.
    log2_points : int
        Binary logarithm of the number of points, up to 30.

    Raises
    ------
    ValueError
        If there are more dimensions than direction numbers.

    Examples
    --------
    >>> points = scrambled_sobol(3, 4)
    >>> np.sort((16 * points).astype(int), axis=0).T.tolist() == 3 * [list(range(16))]
    True
    """
    if not 1 <= dimensions <= MOST_DIMENSIONS:
        raise ValueError(f"dimensions: got {dimensions}; expected 1 to {MOST_DIMENSIONS}")
    rng = np.random.default_rng(0).spawn(1)[0]
    shift = rng.integers(2, size=(dimensions, BITS), dtype=np.uint32)
    lower = np.tril(rng.integers(2, size=(dimensions, BITS, BITS), dtype=np.uint32), -1)
    lower += np.eye(BITS, dtype=np.uint32)
    place = np.arange(BITS, dtype=np.uint32)
    directions = _directions(dimensions)
    digits = (directions[:, None, :] >> place[::-1, None]) & 1  # the highest first
    scrambled = ((lower @ digits % 2) << place[::-1, None]).sum(axis=1, dtype=np.uint32)
    number = np.empty((2**log2_points, dimensions), dtype=np.uint32)
    number[0] = (shift << place).sum(axis=1, dtype=np.uint32)
    for bit in range(log2_points):  # in the order of Gray's code, each half mirrors the other
        half = 2**bit
        number[half : 2 * half] = number[:half][::-1] ^ scrambled[:, bit]
    return number / 2.0**BITS


def _directions(dimensions: int) -> np.ndarray:
    """Return the direction numbers, shape (dimensions, BITS), as fractions of 2^BITS."""
    found = np.empty((dimensions, BITS), dtype=np.uint32)
    found[0] = 1
    for row, (polynomial, first) in zip(found[1:], DIRECTIONS, strict=False):
        degree = len(first)
        row[:degree] = first
        for i in range(degree, BITS):
            row[i] = row[i - degree]
            for k in range(1, degree + 1):
                if polynomial >> (degree - k) & 1:
                    row[i] ^= row[i - k] << np.uint32(k)
    return found << np.arange(BITS, dtype=np.uint32)[::-1]
