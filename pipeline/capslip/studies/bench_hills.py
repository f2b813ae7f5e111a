"""Benchmark of the separation of hills: time and agreement, beside scikit-image's watershed.

`python -m capslip.studies.bench_hills` prints the table. scikit-image gets the same averaged
heights at the same points above the cut; it only floods them, without saddles, pruning or checks.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from capslip.caps.hills import find_hills
from capslip.caps.separation import change_tree
from capslip.surface.conditioning import condition
from capslip.surface.synthetic import CapFamily, Scene, synthetic_surface


@dataclass(frozen=True)
class Row:
    """Times of one scene, medians in milliseconds."""

    scene: str
    n_hills: int
    n_known: int | None  # caps that the scene holds
    find_hills_ms: float  # cut, noise, averaging, tree, pruning, labels
    regions_ms: float  # the same with separation="regions"
    change_tree_ms: float  # the tree alone
    watershed_ms: float  # skimage.segmentation.watershed on the same points
    equal_share: float  # of the points above the cut that both give to the same peak


def bench_hills(repeats: int = 7) -> list[Row]:
    """Time the separation on scenes of 1200 x 800 points.

    Parameters
    ----------
    repeats : int
        Calls of each function; the median counts. The functions take turns.

    Returns
    -------
    list of Row
    """
    face = Scene(
        seed=1,
        families=(CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 0.2e-6)),
        gap_m=5e-4,
        waviness_rms_m=0.03e-6,
        tilt=(2e-5, -3e-5),
    )
    many = replace(face, families=(CapFamily("G", 300, 3.0),), gap_m=2.5e-4)
    noise = Scene(seed=2, noise_rms_m=1e-7)
    scenes = {
        "23 caps": face,
        "23 caps, noise, 2 % missing": replace(face, noise_rms_m=8e-9, non_measured_fraction=0.02),
        "300 caps": many,
        "300 caps, noise, 2 % missing": replace(many, noise_rms_m=2e-8, non_measured_fraction=0.02),
        "short waves": replace(noise, noise_rms_m=0.0, waviness_rms_m=1e-7, waviness_length_m=4e-4),
        "white noise": noise,
    }
    return [_row(name, scene, repeats) for name, scene in scenes.items()]


def _row(name: str, scene: Scene, repeats: int) -> Row:
    from scipy.ndimage import uniform_filter
    from skimage.segmentation import watershed

    surface = condition(synthetic_surface(scene, name)[0]).surface
    hills = find_hills(surface)
    above = surface.height_m >= hills.cut_height_m
    above[[0, -1]] = above[:, [0, -1]] = False  # the tree takes no point on the edge
    filled_m = np.where(surface.measured, surface.height_m, hills.cut_height_m)
    mean_m = uniform_filter(filled_m, hills.square)
    point = np.flatnonzero(above)
    times_ms, results = _medians_ms(
        repeats,
        lambda: find_hills(surface),
        lambda: find_hills(surface, separation="regions"),
        lambda: change_tree(point, mean_m.reshape(-1)[point], surface.shape),
        lambda: watershed(-mean_m, mask=above, connectivity=2),
    )
    tree, flooded = results[2:]
    known = sum(family.count for family in scene.families)
    return Row(
        scene=name,
        n_hills=hills.n_hills,
        n_known=known or None,
        find_hills_ms=times_ms[0],
        regions_ms=times_ms[1],
        change_tree_ms=times_ms[2],
        watershed_ms=times_ms[3],
        equal_share=_equal_share(tree.hill, flooded.reshape(-1)[tree.point]),
    )


def _medians_ms(repeats: int, *functions: Callable[[], Any]) -> tuple[list[float], list[Any]]:
    times_s = np.empty((repeats, len(functions)))
    results: list[Any] = [None] * len(functions)
    for turn in times_s:
        for i, function in enumerate(functions):
            begin = time.perf_counter()
            results[i] = function()
            turn[i] = time.perf_counter() - begin
    return (1e3 * np.median(times_s, axis=0)).tolist(), results


def _equal_share(first: np.ndarray, second: np.ndarray) -> float:
    """Share of the points whose two labels go together most often."""
    _, start, counts = np.unique(
        first.astype(np.int64) * (int(second.max()) + 1) + second,
        return_index=True,
        return_counts=True,
    )
    best = np.zeros(int(first.max()) + 1)
    np.maximum.at(best, first[start], counts)
    return float(best.sum() / len(first))


def _table(rows: list[Row]) -> str:
    head = "| scene | hills | known | all ms | regions ms | tree ms | watershed ms | equal |"
    lines = [head, "| --- " * 8 + "|"]
    lines += [
        f"| {row.scene} | {row.n_hills} | {'-' if row.n_known is None else row.n_known} "
        f"| {row.find_hills_ms:.0f} | {row.regions_ms:.0f} | {row.change_tree_ms:.0f} "
        f"| {row.watershed_ms:.0f} | {100 * row.equal_share:.0f} % |"
        for row in rows
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(_table(bench_hills()) + "\n")
