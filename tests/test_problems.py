"""Every problem of the registry is said of a face that has its cause, and not of the same without.

A row names a code, its severity, what the message must say of this very case, the face with the
cause, and the same face with the one cause taken away.
"""

import json
import re
import tempfile
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import get_type_hints

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.ndimage import gaussian_filter, zoom

from capslip import sensitivity
from capslip.analysis import _with_band, analyze, analyze_once
from capslip.cli import main
from capslip.contact.choice import WHY
from capslip.next_steps import PRESSED
from capslip.options import MODELS
from capslip.problems import KINDS, Problem, warnings_page
from capslip.settings import Settings, load_settings
from capslip.stages import Clock
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface
from scenes import PROJECT, caps_map

pytestmark = pytest.mark.usefixtures("fewer_points")  # what is said is asked, not how great it is

# Messages that say that something is so, and have no number to say
WITHOUT_NUMBER = {"beam_ignored", "contact_reaches_below_cut", "one_contact", "output_missing"}
WITHOUT_NUMBER |= {"P_not_in_contact", "peak_at_gross_slip", "reader_note", "settings_ignored"}

SHAPE, PIXEL_M = (120, 180), 4e-4
Y_M, X_M = (np.mgrid[: SHAPE[0], : SHAPE[1]] + 0.5) * PIXEL_M
# 4 G-caps and 8 P-caps, 100 nm lower, in four columns and three rows that balance about the middle
CAPS = [
    (9e-3 + 18e-3 * j, 8e-3 + 16e-3 * i, 27.0 if (i + j) % 3 else 24.0, -1e-7 * ((i + j) % 3 > 0))
    for i in range(3)
    for j in range(4)
]
UNEVEN = Path(tempfile.mkdtemp()) / "pressures.csv"
UNEVEN.write_text("pressure_Pa,area_m2\n2e5,0.002\n1e-3,0.002\n")
SPREAD = UNEVEN.with_name("spread.csv")
SPREAD.write_text("pressure_Pa,area_m2\n2e5,0.002\n2,20\n")
GAP = (18e-3, 16e-3)  # the middle of four caps


def caps(*more, only=CAPS, without=()):
    kept = [cap for i, cap in enumerate(only) if i not in without]
    return caps_map([*kept, *more], SHAPE, (PIXEL_M, PIXEL_M), floor_m=-4e-7)


def of(height_m, pixel_size_m=(PIXEL_M, PIXEL_M)):
    return HeightMap(height_m, pixel_size_m)


def plain_m():
    return caps().height_m.copy()


def white(seed=1):
    return np.random.default_rng(seed).standard_normal(SHAPE)


def waves(width, seed=5):
    z = gaussian_filter(white(seed), width)
    return z / z.std()


def quarter(height_m):
    """Return the first half of the rows and columns: waves are alike everywhere."""
    return height_m[: SHAPE[0] // 2, : SHAPE[1] // 2].copy()


def at(index, change_m):
    """Add a height to some points."""
    z = plain_m()
    z[index] += change_m
    return of(z)


def at_the_edge(*which):
    return caps(*((0.5e-3, *CAPS[i][1:]) for i in which), without=which)


def patched(*which):
    """Lose a patch beside the apex of some caps."""
    z = plain_m()
    for i in which:
        x, y = CAPS[i][:2]
        z[(abs(X_M - x - 1.5e-3) < 1.2e-3) & (abs(Y_M - y) < 1.2e-3)] = np.nan
    return of(z)


def ridges(*which):
    """Stretch some caps twenty times along x."""
    z = caps(without=which).height_m
    for i in which:
        x, y, radius_m, peak_m = CAPS[i]
        z = np.maximum(z, peak_m - ((X_M - x) ** 2 / 40.0 + (Y_M - y) ** 2) / radius_m)
    return of(z)


def long_caps():
    """Twelve caps that are all nine times as flat along x as across."""
    z = np.full(SHAPE, -4e-7)
    for x, y, radius_m, peak_m in CAPS:
        fall_m = ((X_M - x) ** 2 / 3.0 + (Y_M - y) ** 2 * 3.0) / (2.0 * radius_m)
        z = np.maximum(z, peak_m - fall_m)
    return of(z)


def twins(apart_m, radius, *which):
    """Put two caps in the place of one."""
    old = [(*CAPS[i], d) for i in which for d in (-apart_m, apart_m)]
    return caps(*((x + d, y, radius * R, z) for x, y, R, z, d in old), without=which)


def unsettled():
    """Waves whose contact and fit go to and fro: no rule is known that makes one."""
    rng = np.random.default_rng(12)
    z = rng.standard_normal((60, 90))
    z = gaussian_filter(z, rng.uniform(1.0, 4.0))
    return of(z / z.std() * 1e-6 * 10.0 ** rng.uniform(-1.0, 0.5), (2e-4, 2e-4))


def pair(finer):
    """Two equal spheres side by side, on a grid so much finer."""
    both = [(4e-3, 4e-3, 20.0, 0.0), (12e-3, 4e-3, 20.0, 0.0)]
    return caps_map(both, (40 * finer, 80 * finer), (2e-4 / finer, 2e-4 / finer))


def small_caps(n, coarser=1):
    """Add caps that stand 40 nm above the cut, on a grid so much coarser."""
    low = [(x, y, 6.0, -1.3e-7) for x, y in (GAP, (36e-3, 16e-3), (54e-3, 32e-3))]
    first, size_m = coarser // 2, (coarser * PIXEL_M, coarser * PIXEL_M)
    return of(caps(*low[:n]).height_m[first::coarser, first::coarser].copy(), size_m)


def sieve(share):
    """Lose points here and there."""
    return at(np.random.default_rng(4).random(SHAPE) < share, np.nan)


def pimples():
    """Spheres a few pixels apart, no two alike: each has a few points above the cut."""
    x_m, y_m = ((np.arange(n) * 5 + 2.5) * 2e-4 for n in (15, 10))
    radius_m = np.random.default_rng(3).uniform(0.4, 0.6, (10, 15))
    both = [(x, y, radius_m[i, j], 0.0) for i, y in enumerate(y_m) for j, x in enumerate(x_m)]
    return caps_map(both, (50, 75), (2e-4, 2e-4))


EVERY = range(12)
FACES = {
    "plain": caps,
    "coarse": lambda: of(plain_m()[::2, ::2], (2.0 * PIXEL_M, 2.0 * PIXEL_M)),
    "coarser": lambda: of(plain_m()[1::3, 1::3], (3.0 * PIXEL_M, 3.0 * PIXEL_M)),
    # Caps on the lattice have few heights: without noise they look stored in steps
    "clipped": lambda: of(np.minimum(plain_m() + 1e-10 * white(), -2e-8)),
    "ends-below": lambda: of(np.maximum(plain_m() + 1e-10 * white(), -1.05e-7)),
    "worn-below": lambda: of(np.maximum(plain_m(), -1.05e-7)),
    "clipped-in-steps": lambda: of(np.minimum(np.round(plain_m() / 4e-9), -5.0) * 4e-9),
    "mm-as-m": lambda: of(2e6 * plain_m()),
    "steep": lambda: of(1e5 * plain_m()),
    "sharp": lambda: of(1e3 * plain_m()),
    "of-an-atom": lambda: of(1e-4 * plain_m()),
    "small-field": lambda: of(plain_m(), (1e-5, 1e-5)),
    "of-metres": lambda: of(plain_m(), (1e-2, 1e-2)),
    "trenched": lambda: at((slice(None), np.arange(SHAPE[1]) % 12 < 3), -5e-3),
    "spike": lambda: at((5, 5), 1e-5),
    "pit": lambda: at((5, 5), -1e-4),
    "shallow-pit": lambda: at((5, 5), -6e-7),
    "dust": lambda: at((slice(None, None, 7), slice(None, None, 6)), 2e-6),
    "oblong": lambda: of(plain_m(), (PIXEL_M, 1.5 * PIXEL_M)),
    "very-oblong": lambda: of(plain_m(), (0.3 * PIXEL_M, 3.0 * PIXEL_M)),
    "hole": lambda: at(np.hypot(X_M - GAP[0], Y_M - 24e-3) < 8e-3, np.nan),
    "cornered": lambda: at(X_M / 72e-3 + Y_M / 48e-3 < 0.6, np.nan),
    "round": lambda: at(np.hypot(X_M - 36e-3, Y_M - 24e-3) > 24e-3, np.nan),
    "sieve": lambda: sieve(0.8),
    "coarse-sieve": lambda: sieve(0.99),
    "tilted": lambda: of(plain_m() + 1e-6 * X_M),
    "mean": lambda: replace(caps(), form_error_m=1e-7),
    "mean-of-much-alike": lambda: replace(caps(), form_error_m=6e-9),
    "bowed": lambda: of(plain_m() + 1e-7 * (X_M / 36e-3 - 1.0) ** 2),
    "interpolated": lambda: of(
        zoom(FACES["in-one-field"]().height_m[::3, ::3], 3, order=1, grid_mode=True, mode="nearest")
    ),
    "stitched": lambda: of(plain_m() + 8e-8 * (X_M > 36e-3) + 1e-9 * waves(2)),
    "in-one-field": lambda: of(plain_m() + 1e-9 * waves(2)),
    "rippled": lambda: of(plain_m() + 1.5e-8 * np.cos(2.0 * np.pi * Y_M / 3.3e-3)),
    "hardly-rippled": lambda: of(plain_m() + 3e-9 * np.cos(2.0 * np.pi * Y_M / 3.3e-3)),
    "twins-that-touch": lambda: twins(0.7e-3, 1.0, *EVERY),
    "twins-apart": lambda: twins(2e-3, 0.25, *EVERY),
    "sharp-twins": lambda: twins(1.2e-3, 0.25, *EVERY),
    "one-pair": lambda: twins(1.2e-3, 0.25, 1),
    "all-P-pairs": lambda: twins(1.2e-3, 0.25, 1, 2, 4, 5, 7, 8, 10, 11),
    "all-noise": lambda: of(plain_m() + 1e-5 * white()),
    "noisy": lambda: of(plain_m() + 2e-8 * white()),
    "rough": lambda: of(plain_m() + 4e-8 * white()),
    # Hills of few pixels: in every turn some pixel crosses the depth of its fit
    "restless": lambda: of(2e-7 * waves(2.5)),
    "faintly-noisy": lambda: of(plain_m() + 6e-9 * white()),
    "hardly-noisy": lambda: of(plain_m() + 1e-9 * white()),
    "waved": lambda: of(plain_m() + 5e-8 * waves(2)),
    "ground": lambda: of(1e-6 * waves(3)),
    "high-floor": lambda: of(np.maximum(plain_m(), -1.9e-7)),
    "one-at-the-edge": lambda: at_the_edge(0),
    "three-at-the-edge": lambda: at_the_edge(0, 4, 8),
    "one-patch": lambda: patched(1),
    "four-patches": lambda: patched(0, 1, 2, 3),
    "topless": lambda: at(np.hypot(X_M - CAPS[4][0], Y_M - CAPS[4][1]) < 2.5e-3, np.nan),
    "one-ridge": lambda: ridges(5),
    "three-ridges": lambda: ridges(1, 5, 9),
    "long-caps": long_caps,
    "quantised": lambda: of(np.round(plain_m() / 2e-7) * 2e-7),
    "in-steps": lambda: of(np.round(plain_m() / 2e-8) * 2e-8),
    "in-wide-steps": lambda: of(np.round(plain_m() / 6e-8) * 6e-8),
    "low-cap": lambda: caps((*GAP, 24.0, -1.9e-7)),
    "noisy-low-cap": lambda: of(FACES["low-cap"]().height_m + 6e-9 * white()),
    "lowest-cap": lambda: caps((*GAP, 10.0, -2.2e-7)),
    "one-grain": lambda: caps((*GAP, 1.5, -5e-8)),
    "one-tall-grain": lambda: caps((*GAP, 1.5, 1e-7)),
    "small-cap": lambda: small_caps(1),
    "coarse-small-cap": lambda: small_caps(1, 2),
    "small-caps": lambda: small_caps(3),
    "coarse-small-caps": lambda: small_caps(3, 2),
    "four-grains": lambda: caps(
        *(
            (x, y, 1.5, -5e-8)
            for x, y in ((18e-3, 16e-3), (36e-3, 16e-3), (54e-3, 16e-3), (36e-3, 32e-3))
        )
    ),
    "four-tall-grains": lambda: caps(
        *(
            (x, y, 1.5, 1e-7)
            for x, y in ((18e-3, 16e-3), (36e-3, 16e-3), (54e-3, 16e-3), (36e-3, 32e-3))
        )
    ),
    "unsettled": unsettled,
    "one-height": lambda: caps(only=[(x, y, 24.0, 0.0) for x, y, *_ in CAPS]),
    "a-little-waved": lambda: of(plain_m() + 2e-8 * waves(2)),
    "low-side": lambda: caps(only=[(x, y, 24.0, -1e-7 * (y > 24e-3)) for x, y, *_ in CAPS]),
    "deep-P": lambda: caps_map(
        [(x / 2, y / 2, R, 2 * z) for x, y, R, z in CAPS], SHAPE, (2e-4, 2e-4), floor_m=-8e-7
    ),
    "short-waves": lambda: of(2e-7 * quarter(waves(2.5))),
    "every-other-wave": lambda: of(
        1e-7 * quarter(waves(1.0))[::2, ::2], (2.0 * PIXEL_M, 2.0 * PIXEL_M)
    ),
    "every-wave": lambda: of(1e-7 * quarter(waves(1.0))),
    "long-waves": lambda: of(2e-7 * waves(2.5) + 2e-8 * np.cos(2.0 * np.pi * X_M / 0.04)),
    "longer-waves": lambda: of(2e-7 * quarter(waves(3.5))),
    "noisy-waves": lambda: of(2e-7 * waves(8.0) + 4e-9 * white()),
    "pimples": pimples,
    "coarse-pair": lambda: pair(1),
    "fine-pair": lambda: pair(2),
    "fine-sphere": lambda: caps_map([(2.3e-3, 2.25e-3, 20.0, 0.0)], (91, 91), (5e-5, 5e-5)),
    "pattern": lambda: of(1e-6 * quarter(waves(3, 1))),
    "its-counterpart": lambda: of(
        -1e-6 * quarter(waves(3, 1))[:, ::-1] + 1e-7 * quarter(waves(2, 3))
    ),
    "another-pattern": lambda: of(1e-6 * quarter(waves(3, 2))),
}


WORDS = {
    "kept": "conditioning.outliers=none",
    "as-it-lay": "conditioning.form=none",
    "quadratic": "conditioning.form=quadratic",
    "to-its-floor": "conditioning.form_floor=true",
    "of-a-known-bow": "instrument.flatness_deviation_m=1e-7",
    "of-little-bow": "instrument.flatness_deviation_m=4e-9",
    "of-no-bow": "instrument.flatness_deviation_m=1e-12",
    "of-known-noise": "instrument.noise_m=4e-9",
    "through-optics": "instrument.lateral_period_limit_m=1.6e-3",
    "through-better-optics": "instrument.lateral_period_limit_m=0.4e-3",
    "by-place": "mating.align=least_squares",
    "together": "mating.way=together",
    "aside": "mating.offset_m=[0.0,0.05]",
    "levelled": "contact.alignment=as_levelled",
    "beside": "contact.load_point_m=[0.002,0.024]",
    "fixed": "hills.cut=fixed",
    "regions": "hills.separation=regions",
    "coarsely": "hills.pruning_height_m=4e-8",
    "very-coarsely": "hills.pruning_height_m=1e-7",
    "half": "hills.material_ratio=0.5",
    "fifth": "hills.material_ratio=0.2",
    "pinned": "caps.fit=pinned",
    "flat": "contact.model=flat",
    "alone": "contact.model=caps",
    "families": "contact.model=families",
    "solved": "contact.model=boundary_elements",
    "smoothed": "conditioning.s_filter_nesting_index_m=2e-3",
    "filtered": "conditioning.l_filter_nesting_index_m=0.03",
    "at-more-rows": "conditioning.resample_to=[180,180]",
    "at-its-points": "conditioning.resample_to=[120,180]",
    "at-fewer-points": "conditioning.resample_to=[80,120]",
    "at-a-quarter": "conditioning.resample_to=[60,90]",
    "at-fewer-than-that": "conditioning.resample_to=[40,60]",
    "hurried": "contact.time_limit_s=1e-3",
    "at-leisure": "contact.time_limit_s=60",
    "in-whole": "run.sensitivity=false",  # and not `analyze_once`
    "with-bulk": "contact.bulk=true",
    "rubber": "material.youngs_modulus_Pa=[1e8,1e8]",
    "plastics": "material.youngs_modulus_Pa=[2e9,2e9]",
    "on-plastics": "material.youngs_modulus_Pa=[200e9,3e9]",
    "weak": "material.yield_stress_Pa=1e6",
    "strong": "material.yield_stress_Pa=1e9",
    "sticky": "material.friction_coefficient=2.0",
    "stiff-mode": "structure.modal_stiffness_N_per_m=1e9",
    "soft-mode": "structure.modal_stiffness_N_per_m=1e8",
    "joint": "structure.joint_stiffness_N_per_m=5e7",
    "stiff-joint": "structure.joint_stiffness_N_per_m=5e8",
    "part": "joint.area_m2=0.02",
    "of-less": "joint.area_m2=2e-3",
    "in-time": "contact.model=auto",
    "strictly": "contact.tolerance=0.01",
    "less-strictly": "contact.tolerance=0.1",
    "loosely": "contact.tolerance=0.9",
    "uneven": f"joint.pressure_map={UNEVEN}",
    "spread": f"joint.pressure_map={SPREAD}",
    "along": "slip.direction_rad=0.0",
    "void": "joint.non_measured=void",
    "pushed": "answer.slip_force_N=500",
    "barely-pushed": "answer.slip_force_N=0.1",
    "lagging": "slip.normal_phase_rad=1.2",
    "swinging": "slip.normal_amplitude_ratio=0.3",
    "beam": "structure.beam.length_m=0.5",
}


@dataclass(frozen=True)
class Row:
    """One code at one severity; each face as `face+mate word word N=preload`."""

    code: str
    severity: str
    says: str
    seen: str
    silent: str = "plain"
    swept: str = ""  # what to sweep, where it takes the sensitivity to see it


ROWS = [
    Row("clipped", "info", "64 points share", "clipped"),
    Row("clipped", "warning", "higher than they look", "clipped-in-steps"),
    Row("slope_suspect", "error", "a face only 0.048 m wide", "mm-as-m"),
    Row("slope_suspect", "warning", "rms slope 3.4", "steep"),
    Row("slope_suspect", "info", "in its highest 10%: deep walls", "trenched"),
    Row("scale_suspect", "warning", "4.03e-11 m, less than an atom", "of-an-atom"),
    Row("scale_suspect", "warning", "the face is 1.8 m long", "of-metres"),
    Row("outliers", "warning", "peaks stand 9.96e-06 m above", "spike kept", "spike"),
    Row("outliers", "info", "pits lie 0.0001 m below", "pit kept", "pit"),
    Row("outliers_removed", "info", "0 of them upwards", "shallow-pit", "shallow-pit kept"),
    Row("outliers_removed", "warning", "1 of them upwards", "spike", "spike kept"),
    Row("outliers_removed", "warning", "540 points (2.5 %)", "dust", "dust kept"),
    Row("spikes", "warning", "1 of them lie in the highest 10 %", "spike kept", "spike"),
    Row("spikes", "info", "0 of them lie", "shallow-pit kept", "shallow-pit"),
    Row("non_square_pixels", "info", "0.0004 x 0.0006 m", "oblong"),
    Row("non_square_pixels", "warning", "0.00012 x 0.0012 m", "very-oblong"),
    Row("hole_may_hide_hills", "warning", "a disc of 0.00757 m radius", "hole"),
    Row("hole_may_hide_hills", "info", "moves the stiffness by", "hole loosely"),
    Row("tops_in_holes", "warning", "took the tops of hills (1)", "topless", "hole"),
    Row("tops_in_holes", "info", "moves the stiffness by", "topless loosely"),
    Row("contact_at_hole", "warning", "of the preload rests on contacts that go on",
        "four-patches solved", "plain solved"),
    Row("outline_assumed", "warning", "18.0% of the map", "cornered", "plain"),
    Row("outline_assumed", "info", "21.5% of the map within", "round", "plain"),
    Row("points_filled", "info", "80.1% of the points", "sieve"),
    Row("points_filled", "warning", "99.0% of the points", "coarse-sieve"),
    Row("heights_in_steps", "info", "in steps of 2e-08 m", "in-steps", "clipped"),
    Row("heights_in_steps", "warning", "in steps of 6e-08 m", "in-wide-steps", "noisy"),
    Row("mating_unrelated", "warning", "match by 0", "pattern+another-pattern by-place",
        "pattern+its-counterpart by-place"),
    Row("mating_not_sure", "warning", "may have laid the second face aside",
        "pattern+its-counterpart by-place", "pattern+its-counterpart"),
    Row("mating_not_sure", "info", "may have laid the second face aside",
        "pattern+its-counterpart by-place loosely", "pattern+its-counterpart loosely"),
    Row("mating_overlap", "warning", "on 31 % of the first", "plain+plain aside", "plain+plain"),
    Row("mate_coarse", "warning", "between points 0.0008 m apart",
        "longer-waves+every-other-wave solved strictly N=115",
        "longer-waves+every-wave solved strictly N=115"),
    Row("tilt_left", "warning", "tilted by 7.67e-08 m", "tilted as-it-lay levelled",
        "tilted levelled"),
    Row("tilt_left", "info", "moves the stiffness by", "tilted as-it-lay levelled loosely",
        "tilted levelled"),
    Row("bow_left", "warning", "a bow of 5.", "bowed levelled",
        "bowed levelled quadratic to-its-floor"),
    Row("bow_left", "warning", "bows a flat by 1e-07 m", "plain of-a-known-bow"),
    Row("bow_left", "info", "bows a flat by 4e-09 m", "bowed levelled of-little-bow",
        "bowed levelled of-little-bow quadratic to-its-floor"),
    Row("bow_left", "info", "bows a flat by 4e-09 m", "bowed levelled of-little-bow",
        "bowed levelled of-no-bow"),
    Row("bow_left", "info", "moves the stiffness by", "bowed levelled loosely",
        "bowed levelled quadratic to-its-floor"),
    Row("forms_of_scans_differ", "warning", "a bow of 1e-07 m (standard error)", "mean"),
    Row("forms_of_scans_differ", "info", "a bow of 6e-09 m (standard error)",
        "mean-of-much-alike"),
    Row("bow_left", "warning", "may come of the form that was taken off",
        "low-side quadratic strictly", "low-side quadratic to-its-floor strictly"),
    Row("bow_left", "info", "may come of the form that was taken off", "plain quadratic",
        "plain quadratic to-its-floor"),
    Row("interpolated", "warning", "every 3. row and every 3. column", "interpolated",
        "in-one-field"),
    Row("resampled_finer", "warning", "1.5 x 1 points (along y and x) stand for one that",
        "plain at-more-rows", "plain at-its-points"),
    Row("resampled_coarser", "warning", "to 40 x 60 points, which takes short waves off",
        "short-waves solved at-leisure at-fewer-than-that N=115",
        "short-waves solved at-leisure at-a-quarter N=115"),
    Row("resampled_coarser", "info", "(found on the map with more points)",
        "plain solved at-fewer-points", "plain at-fewer-points"),
    Row("long_waves_filtered", "warning", "m high, the approach is", "long-waves solved filtered",
        "long-waves solved"),
    Row("long_waves_filtered", "info", "(found on the map with",
        "long-waves solved filtered loosely", "long-waves solved loosely"),
    Row("short_waves_filtered", "warning", "took off short waves, and noise, ",
        "short-waves solved smoothed N=115", "short-waves solved N=115"),
    Row("short_waves_filtered", "info", "(found on the map with them, but for white noise)",
        "plain solved smoothed", "plain solved"),
    Row("form_taken_off", "warning", "the form that was taken off (quadratic) is ",
        "long-waves solved quadratic", "long-waves solved"),
    Row("form_taken_off", "info", "the form that was taken off (quadratic) is ",
        "long-waves solved quadratic loosely", "long-waves solved loosely"),
    Row("interpolated", "info", "resolves no more than one of pixels of 0.0012 x 0.0012 m",
        "interpolated solved loosely", "plain"),
    Row("seams", "warning", "2 fields, on levels up to 8", "stitched", "in-one-field"),
    Row("seams", "info", "(estimated with the caps)", "stitched loosely", "in-one-field loosely"),
    Row("ripple", "warning", "m high and 0.0032", "rippled solved", "plain solved"),
    Row("ripple", "info", "(found on the map without it)", "rippled solved loosely",
        "hardly-rippled solved"),
    Row("load_on_floor", "warning", "% of the preload rests", "ends-below solved",
        "worn-below solved"),
    Row("pruning_decides", "warning", "1e-07 m gives 2", "sharp-twins very-coarsely",
        "sharp-twins"),
    Row("no_caps", "error", "'within_noise': 1", "all-noise"),
    Row("connected_network", "warning", "one hill holds 3", "plain half levelled alone"),
    Row("connected_network", "info", "one hill holds 3", "plain half flat"),
    Row("pruning_decides", "info", "1e-07 m gives 2", "sharp-twins very-coarsely flat"),
    Row("shallow_saddles", "info", "50% of the caps", "twins-that-touch flat", "twins-apart"),
    Row("plateau_at_cut", "info", "100% of the points", "high-floor as-it-lay flat"),
    Row("highest_point_on_no_cap", "info", "9.59e-06 m above", "spike kept flat", "spike"),
    Row("caps_plateau", "info", "12 of 12 caps", "quantised flat"),
    Row("not_spherical", "info", "half of the hills", "rough flat"),
    Row("more_than_two_families", "info", "3 levels (4 at", "low-cap flat"),
    Row("families_doubtful", "info", "12 caps do not settle", "a-little-waved flat"),
    Row("family_below_cut", "info", "beside the 4 G-caps", "deep-P solved", "deep-P fixed fifth"),
    Row("hills_too_small", "info", "1 of 13 hills", "coarse-small-cap", "small-cap"),
    Row("hills_too_small", "warning", "3 of 15 hills", "coarse-small-caps levelled families",
        "small-caps levelled families"),
    Row("level_not_settled", "info", "of the load", "restless fixed solved", "plain"),
    Row("cut_too_high", "info", "the cut at 10% stand", "coarser fixed solved N=3000", "coarser"),
    Row("shallow_saddles", "warning", "50% of the caps", "twins-that-touch", "twins-apart"),
    Row("coarse_pruning", "info", "dents up to 4e-08", "plain coarsely"),
    Row("plateau_at_cut", "warning", "100% of the points", "high-floor as-it-lay levelled",
        "plain as-it-lay levelled"),
    Row("highest_point_on_no_cap", "warning", "9.59e-06 m above", "spike kept levelled", "spike"),
    Row("caps_edge", "info", "1 of 12 caps", "one-at-the-edge"),
    Row("caps_non_measured", "info", "1 of 12 caps", "one-patch"),
    Row("caps_plateau", "warning", "12 of 12 caps", "quantised levelled"),
    Row("caps_noisy_apex", "info", "1 of 13 caps", "noisy-low-cap", "low-cap"),
    Row("caps_apex_off_surface", "info", "1 of 12 caps", "one-ridge"),
    Row("caps_ridge", "info", "1 of 12 caps", "one-ridge"),
    Row("caps_ridge", "warning", "3 of 12 caps", "three-ridges"),
    Row("caps_several_peaks", "info", "1 of 12", "one-pair regions levelled", "one-pair levelled"),
    Row("caps_several_peaks", "warning", "8 of 12", "all-P-pairs regions levelled alone",
        "all-P-pairs levelled"),
    Row("caps_outlier", "info", "1 of 13 caps", "one-grain"),
    Row("caps_outlier", "warning", "4 of 16 caps", "four-tall-grains N=20"),
    Row("not_spherical", "warning", "half of the hills", "rough"),
    Row("fit_not_settled", "warning", "still moved", "unsettled levelled N=101",
        "unsettled levelled N=101 pinned"),
    Row("one_family", "info", "12 caps show one family", "one-height"),
    Row("more_than_two_families", "warning", "3 levels (4 at", "low-cap families"),
    Row("families_doubtful", "warning", "12 caps do not settle", "a-little-waved families"),
    Row("family_below_cut", "warning", "beside the 4 G-caps", "deep-P levelled families",
        "deep-P levelled families fifth"),
    Row("contact_failed", "error", "460 N need", "plain rubber"),
    Row("face_closes", "warning", "85% of the face", "coarse in-time N=10000", "coarse in-time"),
    Row("bulk_dominates", "warning", "each 2% of it", "coarser levelled in-time N=2600",
        "coarser levelled in-time"),
    Row("bulk_kept", "warning", "108% of it under 460 N", "plain levelled plastics",
        "plain levelled plastics with-bulk"),
    Row("model_doubtful", "warning", "about 24 %, more than 5 %", "plain alone in-whole",
        "plain in-whole"),
    Row("levelling_decides", "warning", "more than 5 %", "low-side levelled",
        "low-side levelled as-it-lay"),
    Row("boundary_elements_needed", "warning", "more than 5 %", "noisy"),
    Row("noise_decides", "warning", "from 25 % of gross slip on", "faintly-noisy N=100",
        "plain N=100"),
    Row("noise_decides", "info", "from 25 % of gross slip on", "hardly-noisy N=100", "plain N=100"),
    Row("tips_over", "error", "turns over on its -x side", "plain beside"),
    Row("tips_over", "warning", "turns over on its -x side", "plain beside in-time"),
    Row("tips_over", "info", "hull of the 2 peaks", "fine-pair solved N=20",
        "fine-pair solved levelled N=20"),
    Row("not_balanced", "warning", "finds no level", "plain rubber", "plain levelled rubber"),
    Row("level_not_settled", "warning", "moved 0.62% of the load", "restless fixed", "plain"),
    Row("cut_too_high", "warning", "the cut at 10% stand", "plain fixed N=3000", "plain fixed"),
    Row("one_contact", "warning", "one cap", "plain levelled N=0.01"),
    Row("P_not_in_contact", "info", "no P-cap", "plain N=50"),
    Row("contacts_merge", "warning", "8 pairs of contacts", "plain levelled plastics"),
    Row("contact_beyond_cap", "info", "1 contacts", "lowest-cap alone levelled N=1000",
        "lowest-cap alone levelled N=100"),
    Row("contact_beyond_cap", "warning", "12 contacts", "plain levelled plastics"),
    Row("contact_reaches_below_cut", "warning", "down to the cut", "plain levelled plastics"),
    Row("contact_under_resolved", "warning", "at most 1.8 pixels", "plain alone N=1"),
    Row("contact_under_resolved", "info", "at most 1.8 pixels", "plain N=1"),
    Row("contacts_outside_band", "info", "0.00411 m: shorter waves drown in",
        "noisy levelled N=20", "plain levelled N=20"),
    Row("load_on_doubtful_caps", "warning", "25% of the preload", "three-at-the-edge levelled"),
    Row("load_on_doubtful_caps", "info", "25% of the preload",
        "three-at-the-edge levelled loosely"),
    Row("yielded", "info", "hardness of 0.0028 GPa", "plain weak", "plain strong"),
    Row("yielded", "info", "by 11 % and the energy at 25 % of gross slip by 1.3 %, which the",
        "plain weak levelled in-time N=50", "plain strong levelled in-time N=50"),
    Row("pressures_interpolated", "info", "solved once for 2 pressures",
        "noisy levelled solved uneven", "noisy levelled uneven"),
    Row("pressures_interpolated", "warning", "9.1 % of the preload",
        "noisy levelled solved spread", "noisy levelled solved"),
    Row("pressure_beyond_elastic", "warning", "a soft structural steel", "sharp", "sharp strong"),
    Row("pressure_beyond_elastic", "error", "without a hardness", "steep", "steep strong"),
    Row("steep_contacts", "info", "a radius of 0.15 R", "sharp weak levelled alone N=1000",
        "sharp levelled alone N=1000"),
    Row("steep_contacts", "warning", "a radius of 0.43 R", "steep levelled strong alone N=2000",
        "sharp levelled strong alone N=2000"),
    Row("steep_contacts", "error", "a radius of 0.86 R", "steep levelled strong alone N=12000",
        "sharp levelled strong alone N=12000"),
    Row("first_touch_decides", "info", "of the approach of", "one-tall-grain"),
    Row("under_resolved", "info", "9.3 pixels across; 10 are", "noisy levelled solved",
        "plain levelled solved"),
    Row("loss_between_loads", "warning", "% between the 6", "plain solved strictly hurried",
        "plain solved strictly"),
    Row("time_limit_reached", "warning", "after 5 loads", "fine-pair solved levelled hurried N=40",
        "fine-pair solved levelled at-leisure N=40"),
    Row("detail_decides", "warning", "the energy by up to ", "noisy in-time", "plain in-time"),
    Row("detail_decides", "info", "smooth from pixel to pixel",
        "short-waves in-time N=75", "longer-waves in-time N=75"),
    Row("resolution_decides", "warning", "the optics halve waves of 0.0016 m",
        "short-waves in-time through-optics N=75", "short-waves in-time N=75"),
    Row("resolution_decides", "info", "the optics halve waves of 0.0004 m",
        "longer-waves in-time through-better-optics N=75", "longer-waves in-time N=75"),
    Row("noise_taken_off", "info", "white noise of 4e-09 m a point",
        "noisy-waves strictly solved of-known-noise", "noisy-waves strictly solved"),
    Row("caps_not_pressed", "info", "interacting caps may be off by 8", "three-ridges in-time"),
    Row("no_caps", "info", "'too_few_points': ", "pimples levelled in-time"),
    Row("small_slip_extrapolated", "info", "below 4", "fine-sphere solved at-leisure N=60",
        "fine-sphere N=60"),
    Row("small_slip_extrapolated", "warning", "asked for is 0.11 % of",
        "plain solved barely-pushed"),
    Row("slip_direction_matters", "info", "where slip is at 0 degrees", "long-caps",
        "long-caps along"),
    Row("materials_coupled", "warning", "-0.28", "plain on-plastics"),
    Row("friction_suspect", "warning", "is 2;", "plain sticky"),
    Row("beam_ignored", "warning", "structure.beam is not used", "plain stiff-mode joint beam",
        "plain stiff-mode joint"),
    Row("settings_ignored", "warning", "mating.way, mating.offset_m are not used: there is no",
        "plain together aside"),
    Row("settings_ignored", "warning", "conditioning.form_floor is not used: no form",
        "plain as-it-lay to-its-floor", "plain as-it-lay"),
    Row("settings_ignored", "warning", "normal_amplitude_ratio = 0", "plain lagging",
        "plain lagging swinging"),
    Row("not_lightly_damped", "warning", "would be 1.3", "plain levelled soft-mode stiff-joint",
        "plain levelled stiff-mode joint"),
    Row("not_lightly_damped", "info", "of the demonstration beam 400 x 60 x 40 mm",
        "plain levelled N=0.01", "plain levelled"),
    Row("preload_of_demonstration", "warning", "the 460 N of the demonstration on the 2.16e-06 m2",
        "small-field flat", "small-field flat N=460.1"),
    Row("scan_larger_than_joint", "warning", "1.73 times as large", "plain of-less", "plain part"),
    Row("few_contacts_in_scan", "warning", "touches with 7 caps", "plain part", "plain"),
    Row("waves_longer_than_scan", "warning", "m (rms) out of its spectrum, ", "bowed part",
        "bowed quadratic part"),
    Row("beyond_gross_slip", "error", "got slip force 500 N", "plain pushed", "plain"),
    Row("peak_at_gross_slip", "info", "still grows", "plain", "plain flat"),
    Row("sensitive_to_cut", "warning", "from 8 to 12 %", "waved levelled families",
        "plain levelled families", swept="cut"),
    Row("sensitive_to_pruning", "warning", "nm more than the error bar", "waved levelled",
        swept="pruning"),
    Row("sensitive_to_filter", "warning", "from 0 to 1.6e+03 µm", "waved levelled families",
        "plain levelled families", swept="filter"),
    Row("sensitive_to_levelling", "warning", "h and W", "low-side levelled", swept="levelling"),
    Row("sensitive_to_cut", "info", "decides on m and R_G", "waved levelled solved",
        "plain levelled solved", swept="cut"),
    Row("sensitive_to_pruning", "info", "decides on m and W", "waved levelled solved",
        "plain levelled solved", swept="pruning"),
    Row("sensitive_to_filter", "info", "decides on h and R_P", "rough levelled", "plain levelled",
        swept="filter"),
    Row("sensitive_to_levelling", "info", "decides on R_G", "waved", "low-side", swept="levelling"),
]  # fmt: skip


@cache
def surface(name):
    return FACES[name]()


@cache
def analysis(scene, swept=""):
    names, *words = scene.split()
    face, *mate = (surface(name) for name in names.split("+"))
    if swept:
        return with_sweep(face, analysis(scene), swept)
    overrides = [WORDS.get(word, f"contact.preload_{word}") for word in words]
    # No time: caps stand in for a map that nobody asked for, and what is asked has few loads
    limit_s = 60.0 if {"in-time", "strictly"} & set(words) else 1e-3
    settings = load_settings(overrides=(f"contact.time_limit_s={limit_s}", *overrides))
    in_whole = {"in-whole", "strictly"} & set(words)
    return (analyze if in_whole else analyze_once)(face, settings, *mate)


def with_sweep(face, found, name):
    """Add what one sweep of the sensitivity finds, as `analyze` adds that of all."""
    plans = sensitivity._plans
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            sensitivity, "_plans", lambda *of: [one for one in plans(*of) if one.name == name]
        )
        sweeps = sensitivity.sensitivity(
            *(face, found.settings, None, int(found.caps.usable.sum())),
            *(found.hills.pruning_height_m, found.contact is not None),
        )
    doubts = sweeps.problems_for(found.contact.rung)
    return replace(found, sensitivity=sweeps, problems=(*found.problems, *doubts))


def label(row):
    return f"{row.code}-{row.severity}"


@pytest.mark.long
@pytest.mark.parametrize("row", ROWS, ids=label)
def test_a_problem_is_said_where_its_cause_is(row):
    found = analysis(row.seen, row.swept)
    said = [p for p in found.problems if (p.code, p.severity) == (row.code, row.severity)]
    assert said, sorted({f"{p.code} {p.severity}" for p in found.problems})
    assert any(row.says in problem.message for problem in said), [p.message for p in said]
    assert all(re.search(r"\d", p.message) for p in said) or row.code in WITHOUT_NUMBER
    listed = [p for p in found.summary()["problems"] if p["code"] == row.code]
    assert {p.text for p in said} <= {p["message"] for p in listed}
    assert {p["remedy"] for p in listed} == {p.remedy for p in said}
    of_case = [p.step for p in said if p.step not in (None, WHY, PRESSED)]  # the map was pressed
    assert all(re.search(r"--[a-z].*\d", step) for step in of_case)
    assert all(p.step or p.remedy == KINDS[row.code].remedy for p in said)


@pytest.mark.long
@pytest.mark.parametrize("row", ROWS, ids=label)
def test_a_problem_is_not_said_where_its_cause_is_taken_away(row):
    found = analysis(row.silent, row.swept)
    assert row.code not in {problem.code for problem in found.problems}


@pytest.mark.long
def test_the_interval_names_the_warnings_that_it_does_not_hold():
    """A bow that decides would be another face; what detail decides is in the error of the map."""

    def left_out(scene):
        return _with_band(analysis(scene), Clock()).band.left_out

    assert "what bow_left moves" in left_out("bowed levelled")
    assert left_out("bowed levelled loosely") == ()
    assert "detail_decides" in {one.code for one in analysis("noisy in-time").problems}
    assert not any("detail" in one for one in left_out("noisy in-time"))


def test_no_tilt_or_bow_decides_what_touches_on_a_flat_interface():
    for scene in ("plain flat", "bowed flat", "tilted as-it-lay flat"):
        codes = {problem.code for problem in analysis(scene).problems}
        assert not codes & {"bow_left", "tilt_left"}


@pytest.mark.parametrize(
    ("scene", "code"),
    [
        ("hole", "hole_may_hide_hills"),
        ("cornered", "outline_assumed"),
        ("topless", "tops_in_holes"),
        ("HOLED", "contact_at_hole"),
    ],
)
def test_where_no_material_is_nothing_is_hidden_and_caps_end(scene, code):
    holed = next(row.seen for row in ROWS if row.code == "contact_at_hole")
    scene = scene.replace("HOLED", holed)
    unknown, void = analysis(scene), analysis(f"{scene} void")
    assert code in {problem.code for problem in unknown.problems}
    assert code not in {problem.code for problem in void.problems}
    rim = {"caps_non_measured": "caps_edge"}  # of a hole: there the face ends
    codes = [rim.get(problem.code, problem.code) for problem in unknown.problems]
    others = [one for one in codes if one not in ("outline_assumed", code)]
    of_void = [p.code for p in void.problems if p.code != "outline_assumed"]
    if scene == "topless":  # its contact would lie in the hole, where caps do not end
        of_void.remove("boundary_elements_needed")
    assert of_void == others
    if scene == "hole":  # two caps end at its rim
        on_map = analysis("hole solved").contact.stiffness_N_per_m
        of_void, of_unknown = (
            one.contact.stiffness_N_per_m / on_map - 1.0 for one in (void, unknown)
        )
        assert 0.0 < of_void < 0.7 * of_unknown
    else:
        moved = void.contact.stiffness_N_per_m / unknown.contact.stiffness_N_per_m - 1.0
        assert abs(moved) < 1e-12


def test_points_that_stand_alone_are_no_voids():
    codes = {problem.code for problem in analysis("coarse-sieve void").problems}
    assert "hole_may_hide_hills" in codes


def test_a_note_of_the_reader_is_said(tmp_path):
    """The last line of a text that was cut off has no end."""
    lines = "\n".join(" ".join(f"{1e9 * z:.3f}" for z in row) for row in plain_m())
    for text, notes in (
        (lines, ["the last line has no end: the text may be truncated"]),
        (lines + "\n", []),
    ):
        (tmp_path / "face.txt").write_text(text)
        face = load_surface(
            tmp_path / "face.txt", unit="nm", pixel_size=(0.4, 0.4), lateral_unit="mm"
        )
        said = [
            (p.severity, p.message)
            for p in analyze_once(face, Settings()).problems
            if p.code == "reader_note"
        ]
        assert said == [("warning", note) for note in notes]


@pytest.mark.parametrize("said", [1, 0])
def test_what_a_file_settles_itself_is_said_and_changes_no_status(tmp_path, said):
    """A value that the file says for non-measured points, with a point or without."""
    z = plain_m()
    z[0, 0] = -9999.0 if said else z[0, 0]
    with h5py.File(tmp_path / "face.h5", "w") as file:
        file["height"] = z
        units = {"unit": "m", "pixel_size": 2 * [PIXEL_M], "pixel_unit": "m"}
        file["height"].attrs.update({**units, "missing_value": -9999.0})
    found = analyze_once(load_surface(tmp_path / "face.h5"), Settings()).problems
    notes = [(p.severity, p.message) for p in found if p.code == "reader_note"]
    assert notes == said * [("info", "1 points with the missing_value -9999 are non-measured")]


@pytest.mark.parametrize(("more", "said"), [(("--export", "jenkins"), 1), ((), 0)])
def test_a_part_of_the_output_that_is_not_there_is_said(more, said, tmp_path):
    """A Jenkins model needs a slip curve, and three pixels of noise have none."""
    np.save(tmp_path / "face.npy", surface("all-noise").height_m)
    arguments = ["analyze", tmp_path / "face.npy", "--unit", "m", "--lateral-unit", "m"]
    arguments += [
        "--pixel-size",
        PIXEL_M,
        PIXEL_M,
        "--no-figures",
        "--no-render",
        "-q",
        "--set",
        "contact.preload_N=46",
        "-o",
        tmp_path / "out",
        *more,
    ]
    CliRunner().invoke(main, [str(argument) for argument in arguments])
    found = json.loads((tmp_path / "out" / "summary.json").read_text())["problems"]
    found = [problem for problem in found if problem["code"] == "output_missing"]
    assert len(found) == said
    for problem in found:
        assert problem["severity"] == "warning"
        assert problem["message"].startswith("jenkins.csv could not be made: it needs a slip curve")
        assert problem["remedy"] == KINDS["output_missing"].remedy


def test_every_code_of_the_registry_has_a_row():
    rows = {(row.code, row.severity) for row in ROWS}
    rows |= {("reader_note", "info"), ("reader_note", "warning"), ("output_missing", "warning")}
    rows |= {("export_inexact", "info"), ("export_inexact", "warning")}  # in those of the folder
    rows |= {("scans_of_one_place", "warning")}  # in the tests of repeated scans
    rows |= {("settings_ignored", "info")}  # in those of given families
    rows |= {("fit_not_settled", "info")}  # in the tests of what a model reads
    rows |= {("no_caps", "warning")}  # in those of the caps: a levelled face without families
    registered = {(kind.code, severity) for kind in KINDS.values() for severity in kind.severities}
    assert rows == registered


def test_no_hill_has_fewer_points_than_a_fit_needs():
    """So only hills made by hand have the flag `few_points`, and no problem is said of it."""
    from capslip.caps.pruning import MIN_POINTS as of_a_hill
    from capslip.caps.quadric import MIN_POINTS as of_a_fit

    assert of_a_hill >= of_a_fit


def test_a_problem_that_is_not_registered_is_a_defect():
    with pytest.raises(ValueError, match="no problem 'no_such_thing' is registered"):
        Problem("no_such_thing", "warning", "")
    with pytest.raises(ValueError, match="one_family cannot be of severity 'error'"):
        Problem("one_family", "error", "")


def test_the_page_of_warnings_is_that_of_the_registry():
    page = PROJECT / "docs" / "warnings.md"
    assert page.read_text(encoding="utf-8") == warnings_page(), "run `make warnings`"


KIND_ROWS = [pytest.param(kind, id=kind.code) for kind in KINDS.values()]


@pytest.mark.parametrize("kind", KIND_ROWS)
def test_what_a_remedy_names_exists(kind):
    text = f"{kind.effect} {kind.remedy}"
    tables = get_type_hints(Settings)
    for table, key, value in re.findall(r"\b(\w+)\.(\w+|\*)(?:=(\S*[^\s.,;]))?", text):
        if table in tables and key != "csv":
            assert key == "*" or key in get_type_hints(tables[table]), f"{table}.{key}"
            if value and value[-1].isalnum():
                load_settings(overrides=(f"{table}.{key}={value}",))
    for setting in re.findall(r"--set (\w+)", text):
        assert setting in tables
    for model in re.findall(r"--model (?:but )?(\w+)", text):
        assert model in MODELS
    for target in re.findall(r"\bmake ([a-z]+) ", text):
        assert re.search(rf"^{target}:", (PROJECT / "Makefile").read_text(), re.MULTILINE)
    for command in re.findall(r"`capslip (\w+)`", text):
        assert command in main.commands
    options = {name for option in main.commands["analyze"].params for name in option.opts}
    for option in re.findall(r"(?<!\S)-{1,2}[a-z][a-z-]*", text):
        assert option in options


@pytest.mark.parametrize("kind", KIND_ROWS)
def test_a_kind_says_what_it_means_what_it_does_and_what_to_do(kind):
    for text in (kind.meaning, kind.effect, kind.remedy):
        assert len(text.split()) >= 2
    assert kind.severities
    assert isinstance(kind.in_interval, bool)
    assert set(kind.severities) <= {"info", "warning", "error"}
