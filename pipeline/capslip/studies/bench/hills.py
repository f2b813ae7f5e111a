"""Benchmark of the separation of hills: time and agreement, beside scikit-image's watershed.

`python -m capslip.studies.bench.hills` prints the table. scikit-image gets the same averaged
heights at the same points above the cut; it only floods them, without saddles, pruning or checks.
"""

import sys
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from capslip.caps.hills import find_hills
from capslip.caps.separation import change_tree
from capslip.studies.clock import in_turns
from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.studies.page import table
from capslip.surface.conditioning import condition

REPEATS = 5
HEAD = ("scene", "hills", "known", "all ms", "regions ms", "tree ms", "watershed ms", "equal")


def bench_hills() -> str:
    """Time the separation on scenes of 1200 x 800 points.

    Returns
    -------
    str
        A table: hills found, and caps that the scene holds; medians in milliseconds of everything
        (cut, noise, averaging, tree, pruning, labels), of the same with `separation="regions"`, of
        the tree alone, and of the watershed of skimage on the same points; and the share of the
        points that both give to the same peak. The functions take turns. One sentence where
        scikit-image is not installed.
    """
    if find_spec("skimage") is None:
        return "scikit-image is not installed here.\n"
    face = Scene(
        seed=1,
        families=(PAPER[0], replace(PAPER[1], below_m=0.2e-6)),
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
    return table(HEAD, [_cells(name, scene) for name, scene in scenes.items()]) + "\n"


def _cells(name: str, scene: Scene) -> list[str]:
    from scipy.ndimage import uniform_filter
    from skimage.segmentation import watershed

    surface = condition(synthetic_surface(scene, name)[0]).surface
    hills = find_hills(surface)
    above = surface.height_m >= hills.cut_height_m
    above[[0, -1]] = above[:, [0, -1]] = False  # the tree takes no point on the edge
    filled_m = np.where(surface.measured, surface.height_m, hills.cut_height_m)
    mean_m = uniform_filter(filled_m, hills.square)
    point = np.flatnonzero(above)
    functions = (
        lambda: find_hills(surface),
        lambda: find_hills(surface, separation="regions"),
        lambda: change_tree(point, mean_m.reshape(-1)[point], surface.shape),
        lambda: watershed(-mean_m, mask=above, connectivity=2),
    )
    times_s, (*_, tree, flooded) = in_turns(functions, REPEATS)
    known = sum(family.count for family in scene.families)
    equal = _equal_share(tree.hill, flooded.reshape(-1)[tree.point])
    times = [f"{1e3 * time_s:.0f}" for time_s in np.median(times_s[..., 0], axis=0)]
    return [name, str(hills.n_hills), str(known or "-"), *times, f"{100 * equal:.0f} %"]


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


if __name__ == "__main__":
    sys.stdout.write(bench_hills())
