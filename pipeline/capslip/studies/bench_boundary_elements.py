"""Boundary elements beside two published solvers: the same face, tolerance and machine, one run.

Run `python -m capslip.studies.bench_boundary_elements` in an environment that also has Tamaas and
ContactMechanics; a solver that is absent is named, and left out. Every solver is judged by the
same certificate, computed here from the pressures it returns.
"""

import importlib
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from capslip.contact.solvers.polonsky_keer import ElasticFace, elastic_face, press
from capslip.surface.heightmap import HeightMap

E_STAR_PA = 109.89e9
LOAD_N = 460.0
SHAPE = (800, 1200)
PIXEL_SIZE_M = (50e-6, 50e-6)
TOLERANCE = 1e-6
REPEATS = 3


def seeded_face(shape: tuple[int, int] = SHAPE, seed: int = 1) -> HeightMap:
    """Return a face of smooth random waves, 0.4 um rms."""
    from scipy.ndimage import gaussian_filter

    noise = np.random.default_rng(seed).standard_normal(shape)
    waves = gaussian_filter(noise, shape[0] / 16, mode="wrap")
    return HeightMap(0.4e-6 * waves / waves.std(), PIXEL_SIZE_M)


def bench() -> str:
    """Return the table: seconds (median), approach, complementarity and least gap."""
    surface = seeded_face()
    face = elastic_face(surface, E_STAR_PA)
    exact_m = press(face, load_N=LOAD_N, tolerance=1e-10).approach_m
    lines = [
        f"{SHAPE[0]} x {SHAPE[1]} points, {LOAD_N:g} N, tolerance {TOLERANCE:g}, cold, "
        f"median of {REPEATS}",
        f"{'solver':<18}{'seconds':>9}{'approach off':>14}{'complementarity':>17}{'least gap':>12}",
    ]
    solvers: list[tuple[str, Callable[[HeightMap], np.ndarray]]] = [("capslip", _capslip)]
    for name, peer in (("tamaas", _tamaas), ("ContactMechanics", _contact_mechanics)):
        try:
            importlib.import_module(name)
        except ImportError:
            lines.append(f"{name:<18} is not installed here")
        else:
            solvers.append((name, peer))
    for name, solver in solvers:
        times_s = []
        for _ in range(REPEATS):
            begin = time.perf_counter()
            pressure_Pa = solver(surface)
            times_s.append(time.perf_counter() - begin)
        d_m, off, gap = _judged(face, pressure_Pa)
        lines.append(
            f"{name:<18}{statistics.median(times_s):9.2f}{d_m / exact_m - 1:14.1e}{off:17.1e}"
            f"{gap:12.1e}"
        )
    return "\n".join(lines) + "\n"


def _judged(face: ElasticFace, pressure_Pa: np.ndarray) -> tuple[float, float, float]:
    """Return approach, complementarity and least gap of the pressures."""
    sunk_m = face.half_space.sinking_m(pressure_Pa) + face.depth_m
    weight = pressure_Pa / pressure_Pa.sum()
    d_m = float((weight * sunk_m).sum())
    gap = sunk_m / d_m - 1
    return d_m, float((weight * np.abs(gap)).sum()), float(gap[pressure_Pa <= 0].min())


def _capslip(surface: HeightMap) -> np.ndarray:
    face = elastic_face(surface, E_STAR_PA)
    return press(face, load_N=LOAD_N, tolerance=TOLERANCE).pressure_Pa


def _tamaas(surface: HeightMap) -> np.ndarray:
    tamaas: Any = importlib.import_module("tamaas")
    tamaas.initialize(2)
    model = tamaas.ModelFactory.createModel(
        tamaas.model_type.basic_2d, list(surface.side_m), list(surface.shape)
    )
    model.E, model.nu = E_STAR_PA, 0.0
    # Without both of these two calls the solution is the periodic one.
    tamaas.ModelFactory.registerNonPeriodic(model, "dcfft")
    height_m = surface.height_m - surface.height_m.mean()
    solver = tamaas.PolonskyKeerRey(
        model,
        height_m,
        TOLERANCE,
        tamaas.PolonskyKeerRey.pressure,
        tamaas.PolonskyKeerRey.pressure,
    )
    solver.setIntegralOperator("dcfft")
    solver.max_iter = 3000
    solver.solve(LOAD_N / np.prod(surface.side_m))
    return np.asarray(model.traction).reshape(surface.shape).copy()


def _contact_mechanics(surface: HeightMap) -> np.ndarray:
    mechanics: Any = importlib.import_module("ContactMechanics")
    topography: Any = importlib.import_module("SurfaceTopography").Topography
    sides_m = surface.side_m
    substrate = mechanics.FreeFFTElasticHalfSpace(surface.shape, E_STAR_PA, sides_m)
    heights = topography(surface.height_m - surface.height_m.max(), sides_m)
    system = mechanics.Systems.NonSmoothContactSystem(substrate, heights)
    height_m = float(np.ptp(surface.height_m))
    result = system.minimize_proxy(
        external_force=LOAD_N, pentol=TOLERANCE * height_m, maxiter=3000, verbose=False
    )
    inside = np.s_[: surface.shape[0], : surface.shape[1]]
    return np.maximum(np.asarray(result.jac)[inside] / surface.pixel_area_m2, 0.0)


if __name__ == "__main__":
    sys.stdout.write(bench())
