"""Numbers that stand for no height: many neighbours have one, and hardly any another."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip.surface.readers.marks import SHARED, without_marks

SHAPE = (60, 90)
RNG = np.random.default_rng(2)
WAVES = gaussian_filter(RNG.standard_normal(SHAPE), 8.0)
WAVES = 1e-6 * WAVES / WAVES.std()
MEASURED = WAVES + 2e-8 * RNG.standard_normal(SHAPE)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]]
RIM = (Y - 30) ** 2 + (X - 40) ** 2 < 130
LOST = (Y - 30) ** 2 + (X - 40) ** 2 < 80
VIEWS = {
    "as it is": np.asarray,
    "turned": np.transpose,
    "mirrored": lambda z: z[:, ::-1],
    "upside down": np.flipud,
    "float32": np.float32,
}


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
@pytest.mark.parametrize("mark", [0.0, -7e-6, 9e-6, float(MEASURED.min())])
@pytest.mark.parametrize(
    "lost",
    [LOST, RNG.random(SHAPE) < 0.2, Y == 12, X == 3],
    ids=["patch", "points", "row", "column"],
)
def test_a_number_that_many_points_share_is_no_height(view, mark, lost):
    """A zero, what lies outside of the heights, the least of them; wherever and however stored."""
    lost = lost & (mark < MEASURED) if mark == MEASURED.min() else lost
    found, notes = without_marks(view(np.where(lost, mark, MEASURED)))
    blank = lost | (mark == MEASURED)
    np.testing.assert_array_equal(found, view(np.where(blank, np.nan, MEASURED)))
    assert [note.split()[0] for note in notes] == [str(np.count_nonzero(blank))]
    assert without_marks(found) == (found, ())


def test_two_numbers_may_be_marks_and_a_third_says_that_heights_repeat():
    corners = [(Y < 8) & (X < 8), (Y < 8) & (X > 80), (Y > 50) & (X < 8)]
    two = np.select(corners[:2], [8e-6, 9e-6], MEASURED)
    found, notes = without_marks(two)
    assert (np.isnan(found) == (corners[0] | corners[1])).all()
    assert len(notes) == 2
    three = np.where(corners[2], -7e-6, two)
    assert without_marks(three) == (three, ())


@pytest.mark.parametrize(("n", "marks"), [(SHARED, 0), (SHARED + 1, 1)])
def test_few_equal_neighbours_are_chance(n, marks):
    assert len(without_marks(np.where((Y == 5) & (n > X), 0.0, MEASURED + 1e-5))[1]) == marks


@pytest.mark.parametrize(("step_m", "marks"), [(1e-10, 1), (1e-8, 1), (1e-7, 0)])
def test_a_mark_is_told_among_rounded_heights_unless_they_lie_in_few_steps(step_m, marks):
    """As text files of few digits have them: neighbours are equal by chance here and there."""
    rounded = np.round((MEASURED + 1e-5) / step_m) * step_m
    found, notes = without_marks(np.where(LOST, 0.0, rounded))
    assert len(notes) == marks
    assert (np.isnan(found) == (LOST & (marks > 0))).all()


@pytest.mark.parametrize(("range_", "marks"), [(1.9e4, 1), (2.1e4, 0)])
def test_a_code_that_stands_once_is_a_mark_where_it_lies_far_below(range_, marks):
    """Farther below the least of the others than half of their range."""
    z = range_ * (MEASURED - MEASURED.min()) / np.ptp(MEASURED)
    z[20, 30] = -9999.0
    found, notes = without_marks(z)
    assert (len(notes), np.isnan(found).sum()) == (marks, marks)


FLOOR = np.maximum(WAVES, 0.0)
POCKETS = np.where(LOST, -5e-6, WAVES)


@pytest.mark.parametrize(
    "height",
    [
        FLOOR + 0.0 * MEASURED,  # hills on a flat floor, as designed
        POCKETS,  # pockets with walls, as designed
        np.maximum(MEASURED, -1e-6),  # a sensor that ends below: what was measured goes on there
        np.minimum(MEASURED, 1e-6),  # or above
        np.minimum(
            10.0 * np.maximum(WAVES, 0.0) + 1e-9 * RNG.standard_normal(SHAPE), 9e-6
        ),  # steep
        np.round(MEASURED / 1e-8) * 1e-8,  # in steps
        np.where(LOST, MEASURED.max() + 2e-6, MEASURED),  # tops of walls, not far above the rest
        np.zeros(SHAPE),
        np.where(LOST, 0.0, np.nan),
        np.where(LOST, 9e-6, np.where(RIM, np.nan, MEASURED)),  # nothing was measured beside it
        MEASURED[:1],
        MEASURED[:, :2],
    ],
)
def test_what_may_be_heights_stays(height):
    found, notes = without_marks(height)
    assert found is height
    assert notes == ()


@pytest.mark.parametrize("code", [-9999.0, -99999.0, -32768.0, -2147483648.0])
def test_codes_that_programs_write_for_blanks_are_none_among_a_few_heights(code):
    few = np.array([[1.0, 2.0], [code, 3.0], [4.0, 9.0]])
    found, (note,) = without_marks(few)
    np.testing.assert_array_equal(found, np.where(few == code, np.nan, few))
    assert note.startswith(f"1 points with {code:.10g},")
    near = few + np.where(few == code, 0.0, 1.5 * code + 10.0)  # a height below others by as much
    assert without_marks(near) == (near, ())
