"""Boundary elements beside two published solvers: the same face, tolerance and machine, one run.

Run `python -m capslip.studies.bench.boundary_elements` in an environment that also has Tamaas and
ContactMechanics; a solver that is absent is named, and left out. Every solver is judged by the
same certificate, computed here from the pressures it returns.
"""

import importlib
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from capslip.contact.solvers.polonsky_keer import ElasticFace, elastic_face, press
from capslip.studies.clock import in_turns
from capslip.studies.page import table
from capslip.surface.heightmap import HeightMap

E_STAR_PA = 109.89e9
LOAD_N = 460.0
SHAPE = (800, 1200)
PIXEL_SIZE_M = (50e-6, 50e-6)
TOLERANCE = 1e-6
REPEATS = 3
HEAD = ("solver", "seconds", "approach off", "complementarity", "least gap")


def seeded_face(shape: tuple[int, int] = SHAPE) -> HeightMap:
    """Return a face of smooth random waves, 0.4 um rms."""
    from scipy.ndimage import gaussian_filter

    noise = np.random.default_rng(1).standard_normal(shape)
    waves = gaussian_filter(noise, shape[0] / 16, mode="wrap")
    return HeightMap(0.4e-6 * waves / waves.std(), PIXEL_SIZE_M)


def bench_boundary_elements() -> str:
    """Return the table: seconds (median), approach, complementarity and least gap."""
    surface = seeded_face()
    face = elastic_face(surface, E_STAR_PA)
    exact_m = press(face, load_N=LOAD_N, tolerance=1e-10).approach_m
    solvers: dict[str, Callable[[], np.ndarray]] = {"capslip": lambda: _capslip(surface)}
    absent = []
    for name, peer in (("tamaas", _tamaas), ("ContactMechanics", _contact_mechanics)):
        try:
            importlib.import_module(name)
        except ImportError:
            absent.append(f"{name} is not installed here")
        else:
            solvers[name] = partial(peer, surface)
    times_s, found = in_turns(list(solvers.values()), REPEATS)
    rows = []
    for name, seconds, pressure_Pa in zip(
        solvers, np.median(times_s[..., 0], axis=0), found, strict=True
    ):
        approach_m, off, gap = _certificate(face, pressure_Pa)
        rows.append(
            (name, f"{seconds:.2f}", f"{approach_m / exact_m - 1:.1e}", f"{off:.1e}", f"{gap:.1e}")
        )
    size = f"{SHAPE[0]} x {SHAPE[1]} points, {LOAD_N:g} N, tolerance {TOLERANCE:g}, cold"
    lines = [f"{size}, median of {REPEATS}", "", table(HEAD, rows), "", *absent]
    return "\n".join(lines).rstrip() + "\n"


def _certificate(face: ElasticFace, pressure_Pa: np.ndarray) -> tuple[float, float, float]:
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
    sys.stdout.write(bench_boundary_elements())
