"""How long boundary elements take, and which time limit is enough for them."""

import math

TIME_LIMIT = "contact.time_limit_s"
WITHIN = 10.0  # times the estimate, or a limit that was over: within so much maps have an answer
LEAST_S = 10.0  # of small maps, whose contacts are refined, which the estimate does not hold
BOUNDARY_ELEMENTS_S = 2.2e-7  # a point and binary digit of their number, on one core


def boundary_elements_s(shape: tuple[int, int]) -> float:
    """Return about how long boundary elements take on a grid, for one loss curve."""
    points = math.prod(shape)
    return BOUNDARY_ELEMENTS_S * points * math.log2(points)


def enough_s(shape: tuple[int, int], limit_s: float) -> float:
    """Return a time within which a map has an answer, of two digits.

    Parameters
    ----------
    shape : (int, int)
        Its points (ny, nx).
    limit_s : float
        Which was too short.

    Examples
    --------
    >>> enough_s((800, 1200), 1.0), enough_s((800, 1200), 61.8), enough_s((64, 64), 1e-3)
    (42.0, 620.0, 10.0)
    """
    return float(f"{max(WITHIN * max(boundary_elements_s(shape), limit_s), LEAST_S):.1e}")


def more_time(shape: tuple[int, int], limit_s: float) -> str:
    """Return the step from a limit that was too short to one that is enough."""
    return f"--set {TIME_LIMIT}={enough_s(shape, limit_s):g}"
