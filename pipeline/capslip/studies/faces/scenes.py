"""The seeded faces on which the methods are measured, and the real scans where they are present.

A face is made once, on a fine grid. The reference presses that face; the methods see what an
instrument with pixels four times as large would measure of it, with noise or without.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from capslip.errors import ScanError
from capslip.studies.faces.synthetic import CapFamily, Scene, Truth, synthetic_surface
from capslip.surface.blocks import block_sums
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap, Origin
from capslip.surface.readers import load_surface

# Peyret, Chevallier and Dion 2016, Table 2
PAPER = (CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 0.24e-6))
FINE_SHAPE, FINE_PIXEL_M = (800, 1200), (5e-5, 5e-5)  # a face of 60 mm x 40 mm
BLOCK = 4  # fine pixels on a side of a measured one
SCAN_POINTS = 300  # along the longer side, for real scans
# Nominal pressures for scans: of the paper's preload over the synthetic faces, and under a bolt
SCAN_PRESSURES_PA = (0.19e6, 20e6)


@dataclass(frozen=True)
class Case:
    """One face, one load, and how well it was measured."""

    name: str
    group: str  # "caps", "waves", "noise" or "scan"
    preload_N: float
    scene: Scene | None = None  # None for a scan
    noise_rms_m: float = 0.0
    path: Path | None = None  # of a scan


@dataclass(frozen=True, eq=False)
class Face:
    """What a case holds."""

    fine: HeightMap  # the face itself
    measured: HeightMap  # what the methods see
    truth: Truth | None  # of faces of caps


def cases(seed: int = 0) -> tuple[Case, ...]:
    """Return the seeded cases; another seed gives other faces of the same kinds.

    Examples
    --------
    >>> [sum(case.group == group for case in cases()) for group in ("caps", "waves", "noise")]
    [7, 6, 6]
    """
    rng = np.random.default_rng(seed)

    def caps(*families: CapFamily, gap_m: float = 1e-3) -> Scene:
        number = int(rng.integers(2**31))
        return Scene(FINE_SHAPE, FINE_PIXEL_M, seed=number, families=families, gap_m=gap_m)

    def waves(length_m: float, spectrum: Literal["gaussian", "power_law"] = "gaussian") -> Scene:
        number = int(rng.integers(2**31))
        scene = Scene(FINE_SHAPE, FINE_PIXEL_M, seed=number, waviness_rms_m=0.4e-6)
        return replace(scene, waviness_length_m=length_m, waviness_spectrum=spectrum)

    paper = caps(*PAPER)
    equal = caps(CapFamily("G", 12, 25.0))
    many = caps(CapFamily("G", 10, 8.0), CapFamily("P", 50, 9.0, 0.06e-6), gap_m=0.5e-3)
    few = caps(CapFamily("G", 2, 40.0), CapFamily("P", 4, 40.0, 0.1e-6))
    spread = [
        CapFamily("", 1, float(radius_m), float(below_m))
        for radius_m, below_m in zip(
            20.0 * np.exp(0.3 * rng.standard_normal(20)), rng.uniform(0, 0.15e-6, 20), strict=True
        )
    ]
    scattered = caps(*spread, gap_m=0.3e-3)
    short, middle, long = waves(3e-3), waves(5e-3), waves(8e-3)
    rough = waves(2e-3, "power_law")
    return (
        Case("caps of the paper, 460 N", "caps", 460.0, paper),
        Case("caps of the paper, 100 N", "caps", 100.0, paper),
        Case("caps of the paper, 2000 N", "caps", 2000.0, paper),
        Case("12 equal caps, 460 N", "caps", 460.0, equal),
        Case("60 caps, 1000 N", "caps", 1000.0, many),
        Case("6 caps, 200 N", "caps", 200.0, few),
        Case("20 caps of all heights, 460 N", "caps", 460.0, scattered),
        Case("waves of 3 mm, 460 N", "waves", 460.0, short),
        Case("waves of 5 mm, 460 N", "waves", 460.0, middle),
        Case("waves of 5 mm, 100 N", "waves", 100.0, middle),
        Case("waves of 5 mm, 2000 N", "waves", 2000.0, middle),
        Case("waves of 8 mm, 460 N", "waves", 460.0, long),
        Case("self-affine waves, 460 N", "waves", 460.0, rough),
        Case("caps of the paper, 460 N, noise 5 nm", "noise", 460.0, paper, 5e-9),
        Case("caps of the paper, 460 N, noise 20 nm", "noise", 460.0, paper, 20e-9),
        Case("20 caps of all heights, 460 N, noise 5 nm", "noise", 460.0, scattered, 5e-9),
        Case("waves of 3 mm, 460 N, noise 10 nm", "noise", 460.0, short, 10e-9),
        Case("waves of 5 mm, 460 N, noise 10 nm", "noise", 460.0, middle, 10e-9),
        Case("waves of 8 mm, 460 N, noise 30 nm", "noise", 460.0, long, 30e-9),
    )


def scan_cases(folder: str | Path) -> tuple[Case, ...]:
    """Return the cases for each file of a folder that can be read as a height map."""
    found = []
    for path in sorted(Path(folder).iterdir()):
        try:
            surface = load_surface(path)
        except ScanError:
            continue
        area_m2 = float(surface.measured.mean()) * math.prod(surface.side_m)
        for pressure_Pa in SCAN_PRESSURES_PA:
            name = f"{path.name}, {pressure_Pa / 1e6:g} MPa"
            found.append(Case(name, "scan", pressure_Pa * area_m2, path=path))
    return tuple(found)


def make_face(case: Case) -> Face:
    """Make, or read, the face of a case.

    A scan is its own face, as nobody knows what it was measured of: form and outliers off, and
    resampled to a grid on which the reference takes seconds.

    Examples
    --------
    >>> face = make_face(cases()[0])
    >>> face.fine.shape, face.measured.shape, len(face.truth.x_m)
    ((800, 1200), (200, 300), 23)
    """
    if case.scene is None:
        scan = load_surface(str(case.path))
        coarser = min(1.0, SCAN_POINTS / max(scan.shape))
        ny, nx = (max(3, round(coarser * n)) for n in scan.shape)
        surface = condition(scan, "quadratic", resample_to=(ny, nx)).surface
        return Face(surface, surface, None)
    fine, truth = synthetic_surface(case.scene, case.name)
    dy_m, dx_m = fine.pixel_size_m
    height_m = block_sums(fine.height_m, BLOCK) / BLOCK**2
    noise = np.random.default_rng(case.scene.seed + 1).standard_normal(height_m.shape)
    measured = HeightMap(
        height_m + case.noise_rms_m * noise, (BLOCK * dy_m, BLOCK * dx_m), Origin(name=case.name)
    )
    return Face(fine, measured, truth if case.scene.families else None)
