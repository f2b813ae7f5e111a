"""Cases of the limits study: a face, a load, and what is wrong with either or with the scan."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from capslip.surface.heightmap import HeightMap
from capslip.surface.synthetic import CapFamily, Scene, Truth

SHAPE, PIXEL_M = (200, 300), (2e-4, 2e-4)  # a face of 60 mm x 40 mm
PRELOAD_N = 460.0  # of the paper
PAPER = (CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 0.24e-6))
SHARES = (0.25, 0.5, 0.75)  # T / (mu N) at which energies are compared
APART = 1000  # between the seeds of two sets of faces; those of one set differ by less

Row = dict[str, Any]
Change = Callable[[HeightMap, Truth], HeightMap]


@dataclass(frozen=True)
class Case:
    """One face, one load, and what is wrong with either or with the scan."""

    axis: str
    severity: float
    name: str
    scene: Scene
    preload_N: float = PRELOAD_N
    overrides: tuple[str, ...] = ()
    shares: tuple[float, ...] = SHARES
    face_change: Change | None = None  # of the face itself, so of the truth too
    scan_change: Change | None = None  # of what the instrument makes of it
    yield_share: float | None = None  # true greatest pressure over 1.6 times the yield stress


@dataclass(frozen=True)
class Axis:
    """One way to go wrong; its cases run from harmless to hopeless.

    `codes` are the warnings that name the cause.
    """

    name: str
    quantity: str  # what the severity is, with its unit
    codes: tuple[str, ...]
    cases: tuple[Case, ...]
    logarithmic: bool = True


def clean(scene: Scene) -> Scene:
    """Return the scene of the face itself: without form, noise and what the instrument lost."""
    return replace(
        scene,
        noise_rms_m=0.0,
        tilt=(0.0, 0.0),
        bow_m=(0.0, 0.0),
        cylinder_radius_m=None,
        n_spikes=0,
        non_measured_fraction=0.0,
        n_patches=0,
    )


def random_face(seed: int, *families: CapFamily, gap_m: float = 1e-3) -> Scene:
    """Return a face of caps at random places."""
    return Scene(SHAPE, PIXEL_M, seed=seed, families=families, gap_m=gap_m)


def harmless_faces(seed: int) -> dict[str, tuple[Scene, float]]:
    """Return the faces on which most axes are tried, with their preloads.

    Nothing is doubtful about them, so a warning speaks of what the axis does to them.
    """
    first = APART * seed
    smaller = CapFamily("G", 10, 15.0), CapFamily("P", 12, 20.0, 0.1e-6)
    return {
        "caps of the paper": (random_face(first + 1, *PAPER), 200.0),
        "caps of some spread": (scattered_face(1e-8, first + 3), 200.0),
        "smaller caps": (random_face(first + 2, *smaller), PRELOAD_N),
    }


def scattered_face(spread_m: float, seed: int) -> Scene:
    """Return a face of 8 G-caps and 12 P-caps, 0.1 um apart, whose heights and radii scatter."""
    rng = np.random.default_rng(seed)
    caps = [
        CapFamily(
            name,
            1,
            22.0 * math.exp(0.2 * rng.standard_normal()),
            below_m + spread_m * (1.5 + float(np.clip(rng.standard_normal(), -1.5, 1.5))),
        )
        for name, count, below_m in (("G", 8, 0.0), ("P", 12, 0.1e-6))
        for _ in range(count)
    ]
    return random_face(seed, *caps)


def on_faces(
    seed: int,
    axis: str,
    severities: tuple[float, ...],
    text: str,
    make: Callable[[Scene, float], Row],
) -> tuple[Case, ...]:
    """Try each severity on each face; `make` returns what of a case differs."""
    return tuple(
        Case(
            axis,
            severity,
            f"{text.format(severity)}, {name}",
            **{"scene": face, "preload_N": preload_N, **make(face, severity)},
        )
        for severity in severities
        for name, (face, preload_N) in harmless_faces(seed).items()
    )


def scene_axis(
    seed: int,
    axis: str,
    quantity: str,
    severities: tuple[float, ...],
    text: str,
    codes: tuple[str, ...],
    change: Callable[[float], Row],
    overrides: tuple[str, ...] = (),
) -> Axis:
    """Return an axis along which the scene changes, on every harmless face."""
    made = on_faces(
        seed,
        axis,
        severities,
        text,
        lambda face, x: {"scene": replace(face, **change(x)), "overrides": overrides},
    )
    return Axis(axis, quantity, codes, made)
