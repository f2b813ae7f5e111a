"""Wolf's pruning: which hills of a change tree remain, and at which height their number settles."""

import math
from dataclasses import dataclass

import numpy as np

from capslip.caps.separation import ChangeTree

MIN_POINTS = 9  # a sphere and a tilt have five unknowns; fewer points than this say nothing
TOO_SMALL = "too_few_points"  # the reason of these
LEAST_PRUNING = 0.005  # of the relief: a cap with a dent of this depth is still one cap
MOST_PRUNING = 1 / 3  # of the relief: beyond, pruning joins whole caps
STABLE = 0.1  # relative change of the count as the pruning is halved or doubled


@dataclass(frozen=True, eq=False)
class Basins:
    """The unpruned hills of a map.

    Attributes
    ----------
    tree : ChangeTree
        Their peaks and saddles.
    n_points : int64, shape (m,)
        Measured points on each.
    within_noise : bool, shape (m,)
        Whether noise alone would raise it above the cut.
    """

    tree: ChangeTree
    n_points: np.ndarray
    within_noise: np.ndarray

    def points_of(self, group: np.ndarray) -> np.ndarray:
        """Count the measured points of each group, shape (m,)."""
        return np.bincount(group, self.n_points, minlength=len(group))

    def pruned(self, pruning_m: float) -> tuple[np.ndarray, np.ndarray, dict[str, int]]:
        """Join the hills that do not stand out, and reject groups that are no hills.

        Parameters
        ----------
        pruning_m : float
            Hills of less prominence join the one across their saddle; so do those of fewer than 9
            points, whatever their prominence.

        Returns
        -------
        group : int64, shape (m,)
            Group of each unpruned hill: the number of its highest one.
        keep : bool, shape (m,)
            Which of these numbers name a hill.
        rejected : dict
            Groups that are no hills, counted by reason.
        """
        shallow = self.tree.prominence_m < pruning_m
        small = self.points_of(self.tree.join(shallow)) < MIN_POINTS
        group = self.tree.join(shallow | small)
        n_points = self.points_of(group)
        clear = np.bincount(group, ~self.within_noise, minlength=len(group)) > 0
        enough = n_points >= MIN_POINTS
        rejected = {
            TOO_SMALL: int(np.count_nonzero(clear & ~enough)),
            "within_noise": int(np.count_nonzero((n_points > 0) & ~clear)),
        }
        return group, enough & clear, {reason: n for reason, n in rejected.items() if n}

    def count(self, pruning_m: float) -> int:
        """Count the hills that a pruning height leaves."""
        return int(np.count_nonzero(self.pruned(pruning_m)[1]))


def automatic_pruning_m(basins: Basins, noise_m: float, relief_m: float) -> float:
    """Choose the lowest pruning height at which the number of hills hardly depends on it.

    Parameters
    ----------
    basins : Basins
        The unpruned hills.
    noise_m : float
        Height that noise alone may reach.
    relief_m : float
        Usual height of the hills above the cut, positive.

    Returns
    -------
    float
        The noise, or 0.5 % of the relief if that is more, doubled until half and double of it
        change the count by less than 10 %. Where none up to a third of the relief does that, it is
        not doubled at all.
    """
    lowest_m = max(noise_m, LEAST_PRUNING * relief_m)
    doublings = max(0, math.floor(math.log2(MOST_PRUNING * relief_m / lowest_m)))
    ladder_m = lowest_m * 2.0 ** np.arange(-1, doublings + 2)
    counts = [basins.count(height_m) for height_m in ladder_m]
    change = np.array([change_of_count(*counts[i : i + 3]) for i in range(doublings + 1)])
    return float(ladder_m[1 + np.argmax(change < STABLE)])  # the first, also where none is


def change_of_count(n_half: int, n_hills: int, n_double: int) -> float:
    """Greater relative change of the number of hills as the pruning is halved or doubled."""
    return max(n_half - n_hills, n_hills - n_double) / max(n_hills, 1)
