"""Linear programmes in a few unknowns and as many constraints as a map has points."""

from dataclasses import dataclass

import numpy as np

MAX_PIVOTS = 500  # about ten do


@dataclass(frozen=True, eq=False)
class Vertex:
    """The solution of a linear programme in m unknowns.

    Attributes
    ----------
    basis : int64, shape (m,)
        Rows of the constraints that hold with equality there.
    unknowns : float64, shape (m,)
        Where it is.
    weight : float64, shape (m,)
        c as a sum of these rows; not negative.
    """

    basis: np.ndarray
    unknowns: np.ndarray
    weight: np.ndarray


def minimum(
    A: np.ndarray, b: np.ndarray, c: np.ndarray, basis: np.ndarray, rounding: float
) -> Vertex:
    """Minimise c . u under A u >= b by the dual simplex method.

    The row that is violated most enters, and of those in the basis the one leaves that keeps c
    within the cone of the rest.

    Parameters
    ----------
    A, b : ndarray, shape (n, m) and (n,)
        Constraints.
    c : ndarray, shape (m,)
        What is minimised.
    basis : int, shape (m,)
        Independent rows of which c is a sum with weights >= 0, to start from.
    rounding : float
        Violation that does not count.

    Examples
    --------
    The lowest line above three points, at x = 1:

    >>> A, b = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 3.0]]), np.array([0.0, 2.0, 1.0])
    >>> minimum(A, b, np.array([1.0, 1.5]), np.array([0, 2]), 0.0).unknowns
    array([ 2.5, -0.5])
    """
    from scipy.linalg.lapack import dgesv  # of few unknowns, a tenth of the time of its wrappers

    basis, one = basis.copy(), np.eye(len(c))
    for _ in range(MAX_PIVOTS):
        *_, inverse, singular = dgesv(A[basis], one)
        if singular:
            raise np.linalg.LinAlgError("Singular matrix")
        unknowns, weight = inverse @ b[basis], c @ inverse
        violated = b - A @ unknowns
        enters = int(violated.argmax())
        if violated[enters] <= rounding or enters in basis:
            break
        share = A[enters] @ inverse
        falls = share > 1e-12
        if not falls.any():
            break
        ratio = np.maximum(weight, 0.0) / np.where(falls, share, 1.0)
        basis[int(np.where(falls, ratio, np.inf).argmin())] = enters
    return Vertex(basis, unknowns, weight)
