"""What a user writes, held to `mypy --strict` by `tests/test_user.py`; nothing runs it."""

# mypy: disallow-any-generics, disallow-subclassing-any, disallow-untyped-calls
# mypy: disallow-incomplete-defs, disallow-untyped-decorators, warn-return-any, strict-equality
# mypy: extra-checks, no-implicit-reexport

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

import capslip


def loss_factors(scans: list[Path], preload_N: float) -> dict[str, float]:
    """Analyse some scans, draw each and write its folder."""
    settings = capslip.load_settings(overrides=(f"contact.preload_N={preload_N}",))
    found: dict[str, float] = {}
    axes: Axes | None = None
    for path in scans:
        try:
            analysis = capslip.analyze(capslip.load_surface(path), settings)
        except capslip.CapslipError as error:
            found[str(error)] = float("nan")
            continue
        axes = analysis.plot.loss_factor(ax=axes)
        if analysis.damping is not None:
            found[analysis.name] = analysis.damping.peak_loss_factor
        radius_m: np.ndarray = analysis.tables.caps["radius_m"]
        found["mean radius"] = float(radius_m.mean())
        found["Sq"] = analysis.iso25178.field.Sq_m
        summary = capslip.write(analysis, path.parent / "results" / path.stem)
        found["energy"] = summary["answer"]["energy_J"]
    return found


def of_an_array(height_m: np.ndarray) -> str:
    """Analyse an array; the status and the doubts of it."""
    surface = capslip.HeightMap(height_m, (50e-6, 50e-6))
    analysis: capslip.Analysis = capslip.analyze(surface)
    doubts = [f"{problem.code}: {problem.message}" for problem in analysis.problems]
    friction: float = analysis.settings.material.friction_coefficient
    return f"{analysis.status}, mu = {friction}, {', '.join(doubts)}"
