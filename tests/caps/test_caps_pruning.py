"""Wolf's pruning: which hills remain, and the height at which their number settles."""

import numpy as np
import pytest

from capslip.caps.pruning import Basins, automatic_pruning_m, change_of_count
from capslip.caps.separation import change_tree


class Counted:
    """Hills of which only the number at each pruning height is known."""

    def __init__(self, count):
        self.count = count


def test_the_lowest_height_is_that_of_the_noise_or_half_a_per_cent():
    settled = Counted(lambda height_m: 20)
    assert automatic_pruning_m(settled, 0.0, 2.0) == pytest.approx(0.01)
    assert automatic_pruning_m(settled, 0.013, 2.0) == pytest.approx(0.013)


def test_it_is_doubled_until_the_number_settles():
    # 1 / h hills up to 0.03, 20 beyond: 0.08 is the first of which half, itself and double agree
    falling = Counted(lambda height_m: 20 if height_m >= 0.03 else round(1.0 / height_m))
    assert automatic_pruning_m(falling, 0.0, 1.0) == pytest.approx(0.08)
    never = Counted(lambda height_m: round(1e4 / height_m))
    assert automatic_pruning_m(never, 0.0, 1.0) == pytest.approx(0.005)


@pytest.mark.parametrize(("relief_m", "expected_m"), [(1.19, 0.1), (1.21, 0.4)])
def test_it_never_exceeds_a_third_of_the_relief(relief_m, expected_m):
    late = Counted(lambda height_m: 20 if height_m >= 0.2 else round(10.0 / height_m))
    assert automatic_pruning_m(late, 0.1, relief_m) == pytest.approx(expected_m)


@pytest.mark.parametrize(("n_half", "expected_m"), [(109, 0.005), (111, 0.01)])
def test_settled_is_a_change_below_a_tenth(n_half, expected_m):
    step = Counted(lambda height_m: n_half if height_m < 0.004 else 100)
    assert automatic_pruning_m(step, 0.0, 1.0) == pytest.approx(expected_m)


def test_the_change_is_the_greater_of_the_two():
    assert change_of_count(130, 100, 95) == pytest.approx(0.30)
    assert change_of_count(105, 100, 60) == pytest.approx(0.40)
    assert change_of_count(0, 0, 0) == 0.0


def basins(peaks_m, saddles_m, width=4):
    """Make hills in a row, `width` points each, with the given peaks and the saddles between."""
    line = []
    for i, peak_m in enumerate(peaks_m):
        line += [saddles_m[i - 1]] if i else []
        line += [peak_m, *np.linspace(peak_m, saddles_m[min(i, len(saddles_m) - 1)], width)[1:-1]]
    height_m = np.zeros((5, len(line) + 2))
    height_m[1:-1, 1:-1] = np.array(line) - 1e-6 * np.abs(np.arange(3) - 1)[:, None]
    tree = change_tree(np.flatnonzero(height_m), height_m[height_m > 0], height_m.shape)
    m = len(tree.peak_m)
    return Basins(tree, np.bincount(tree.hill, minlength=m), np.zeros(m, dtype=bool))


def test_a_hill_as_prominent_as_the_pruning_stays():
    row = basins([10.0, 9.0, 8.0], [7.0, 6.0])
    prominence_m = np.sort(row.tree.prominence_m)
    assert prominence_m.tolist() == [2.0, 2.0, np.inf]
    assert (row.count(1.99), row.count(2.0), row.count(2.01)) == (3, 3, 1)


def test_small_hills_join_and_those_within_noise_are_rejected():
    row = basins([10.0, 9.0, 8.0], [7.0, 6.0])
    assert row.n_points.tolist() == [9, 12, 12]
    noisy = Basins(row.tree, row.n_points, np.array([False, True, True]))
    group, keep, rejected = noisy.pruned(0.1)
    assert (group.tolist(), keep.tolist()) == ([0, 1, 2], [True, False, False])
    assert rejected == {"within_noise": 2}
    assert noisy.pruned(3.0)[2] == {}  # joined to one that stands above the noise
    few = Basins(row.tree, np.array([9, 8, 9]), row.within_noise)
    assert few.count(0.1) == 2
    fewer = Basins(row.tree, np.array([3, 2, 1]), row.within_noise)
    assert fewer.pruned(0.1)[2] == {"too_few_points": 1}
    fewer = Basins(row.tree, np.array([3, 2, 1]), np.ones(3, dtype=bool))
    assert fewer.pruned(0.1)[2] == {"within_noise": 1}  # no hill, however many points it had
