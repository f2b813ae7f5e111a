"""The form that was taken off a map beside a plane, which may be a part of its face."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from capslip.problems import Problem
from capslip.surface.doubts import VISIBLE_RIPPLE
from capslip.surface.flatness import MOSTLY_FORM
from capslip.surface.form import height_taken_off_m
from capslip.surface.heightmap import HeightMap

if TYPE_CHECKING:
    from capslip.settings import Settings

DEGREE = 6  # of a polynomial that stands for a cylinder or a sphere
FEW_LINES = 60  # each way, on which it is found
ENOUGH = 4  # times its terms, so many points of them; else all points


@dataclass(frozen=True, eq=False)
class TakenForm:
    """A form beside a plane, as a polynomial over a face of any number of points.

    Attributes
    ----------
    terms_m : float64, shape (n, n)
        Of Chebyshev polynomials of y and x, which run from -1 to 1 over the face.
    """

    terms_m: np.ndarray

    def put_back(self, surface: HeightMap) -> HeightMap:
        """Return a map of the same face, on any points, with the form."""
        of_y, of_x = (_chebyshev(np.arange(n), n, len(self.terms_m)) for n in surface.shape)
        return replace(surface, height_m=surface.height_m + of_y @ self.terms_m @ of_x.T)


def taken_form(before: HeightMap, after: HeightMap, degree: int | None) -> TakenForm:
    """Return what was taken off a map, but for a plane.

    Parameters
    ----------
    before, after : HeightMap
        The map with its form and without.
    degree : int or None
        Of the form; None where it is no polynomial.

    Examples
    --------
    >>> from capslip.surface.form import remove_form
    >>> bowed = HeightMap(np.outer(np.ones(40), np.linspace(-1.0, 1.0, 60) ** 2), (1e-4, 1e-4))
    >>> straight, _ = remove_form(bowed, "quadratic")
    >>> again = taken_form(bowed, straight, 2).put_back(straight)
    >>> bool(np.abs(again.height_m - remove_form(bowed, "plane")[0].height_m).max() < 1e-9)
    True
    """
    n_terms = 1 + (DEGREE if degree is None else degree)
    term_y, term_x = np.nonzero(np.add.outer(np.arange(n_terms), np.arange(n_terms)) < n_terms)
    for lines in (FEW_LINES, max(before.shape)):
        rows, cols = (
            np.unique(np.linspace(0, n - 1, min(n, lines)).astype(int)) for n in before.shape
        )
        form_m = before[np.ix_(rows, cols)] - after[np.ix_(rows, cols)]
        row, col = np.nonzero(np.isfinite(form_m))
        if row.size >= ENOUGH * term_y.size:
            break
    of_y = _chebyshev(rows[row], before.shape[0], n_terms)
    of_x = _chebyshev(cols[col], before.shape[1], n_terms)
    plane, every = np.stack([of_y[:, 0], of_y[:, 1], of_x[:, 1]], axis=1), of_y[:, term_y]
    beside_m = form_m[row, col]
    beside_m = beside_m - plane @ np.linalg.lstsq(plane, beside_m)[0]
    terms_m = np.zeros((n_terms, n_terms))
    terms_m[term_y, term_x] = np.linalg.lstsq(every * of_x[:, term_x], beside_m)[0]
    return TakenForm(terms_m)


def _chebyshev(line: np.ndarray, n: int, n_terms: int) -> np.ndarray:
    """Return Chebyshev polynomials at the centres of some of n pixels."""
    return np.polynomial.chebyshev.chebvander((2.0 * line + 1.0) / n - 1.0, n_terms - 1)


def problems_of_taken_form(
    surface: HeightMap, with_form: HeightMap | None, approach_m: float, settings: "Settings"
) -> list[Problem]:
    """Return whether a form was taken off, beside a plane, that may decide what touches.

    Lower than a ripple that is seen it is none. A note alone where it is known whose it is: a
    cylinder or a sphere that makes up most of the relief is the shape that the part was made to,
    and what the instrument makes of a flat is none of the face.

    Parameters
    ----------
    surface : HeightMap
        Without the form.
    with_form : HeightMap or None
        The same face, on the same points, less a plane alone; None where that is all there was.
    approach_m : float
        With which the form is compared.
    settings : Settings
        `conditioning` and `instrument`.
    """
    if with_form is None:
        return []
    height_m = height_taken_off_m(with_form, surface)
    if height_m <= VISIBLE_RIPPLE * approach_m:
        return []
    kind = settings.conditioning.form
    made_m = (settings.instrument.flatness_deviation_m or 0.0) * surface.faces
    message = (
        f"the form that was taken off ({kind}) is {height_m:.3g} m high beside a plane, the "
        f"approach is {approach_m:.3g} m: that is right where the instrument made it, the other "
        "face has it too, or thin parts are pressed flat before they carry, and else K and W are "
        "those of another joint"
    )
    if made := height_m <= made_m:
        message += f"; the instrument makes up to {made_m:.3g} m of a flat"
    left_m2, whole_m2 = (float(np.nanvar(one.height_m)) for one in (surface, with_form))
    shaped = kind in ("cylinder", "sphere") and left_m2 <= (1.0 - MOSTLY_FORM) * whole_m2
    known = made or shaped
    return [Problem("form_taken_off", "info" if known else "warning", message)]
