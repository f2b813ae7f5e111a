"""How often the 90 % interval of the answer holds the truth, over noisy scans of known faces.

The faces are the paper's families at random places; the truth is that of boundary elements on the
face itself, on pixels of a third; the scans are maps of 300 x 200 points with white noise.
"""

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from capslip.analysis import analyze
from capslip.contact.models.boundary_elements import RUNG as BOUNDARY_ELEMENTS
from capslip.contact.models.interacting import RUNG as INTERACTING
from capslip.contact.slip import SlipCurve
from capslip.pressing import press_face
from capslip.settings import load_settings
from capslip.stages import Clock, find_face
from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.studies.page import table

SHAPE, PIXEL_M = (200, 300), (2e-4, 2e-4)
FINER = 3  # pixels of the truth along one of a scan: as many as five move it by 0.05 %
SHARE = 0.25  # of the force at total slip
NUMBERS = ("tangential_stiffness_N_per_m", "energy_J", "joint_loss_factor")


@dataclass(frozen=True, eq=False)
class Held:
    """One scan: the error of each of `NUMBERS` as a logarithm, and whether its interval holds."""

    error: np.ndarray  # (3,)
    width: np.ndarray  # (3,), of the interval, as a logarithm
    holds: np.ndarray  # (3,), bool


def held(
    seed: int, repeats: int, noise_m: float, hardness_Pa: float | None = None
) -> Iterator[Held]:
    """Yield what scans of one face find.

    A scan whose model has an error that is not known has no interval, and is left out.
    """
    yields = () if hardness_Pa is None else (f"material.hardness_Pa={hardness_Pa!r}",)
    settings, exact = (
        load_settings(overrides=(f"contact.model={one.name}", *yields))
        for one in (INTERACTING, BOUNDARY_ELEMENTS)
    )
    scene = Scene(shape=SHAPE, pixel_size_m=PIXEL_M, families=PAPER, seed=seed)
    face, _ = synthetic_surface(scene)
    fine, _ = synthetic_surface(scene, finer=FINER)
    clock = Clock()
    # Nobody asks what is doubtful of the truth, which takes as long as to find it
    _, _, slip = press_face(find_face(fine, exact, None, clock), exact, clock)
    true = _numbers(slip)
    for repeat in range(repeats):
        noise = np.random.default_rng([seed, repeat]).normal(0.0, noise_m, face.shape)
        analysis = analyze(replace(face, height_m=face.height_m + noise), settings)
        if analysis.band is None or analysis.contact is None or analysis.contact.errors is None:
            continue
        found = np.array([getattr(analysis.answer, name) for name in NUMBERS])
        low, high = np.array([analysis.band.interval[name] for name in NUMBERS]).T
        yield Held(np.log(found / true), np.log(high / low), (low <= true) & (true <= high))


def _numbers(slip: SlipCurve) -> np.ndarray:
    """Return `NUMBERS` under a share of the force at total slip."""
    force_N = SHARE * float(slip.total_slip_force_N)
    delta_m, energy_J = float(slip.displacement_m(force_N)), float(slip.energy_at_force_J(force_N))
    return np.array([force_N / delta_m, energy_J, energy_J / (np.pi * force_N * delta_m)])


def table_of_coverage(found: dict[float, list[Held]]) -> str:
    """Return how many of 100 intervals hold the truth, by the noise of the scans."""
    head = (
        "noise [nm]",
        "scans",
        *(f"{name} held [%]" for name in ("stiffness", "W", "W / 2 pi U")),
    )
    head += ("rms error of stiffness, W [%]", "half interval of stiffness, W [%]")
    lines = []
    for noise_m, scans in found.items():
        holds = 100.0 * np.mean([one.holds for one in scans], axis=0)
        error = 100.0 * np.sqrt(np.mean(np.square([one.error for one in scans]), axis=0))
        half = 50.0 * np.mean([one.width for one in scans], axis=0)
        lines.append(
            (
                f"{1e9 * noise_m:g}",
                len(scans),
                *(f"{value:.1f}" for value in holds),
                *(f"{one[0]:.2f}, {one[1]:.2f}" for one in (error, half)),
            )
        )
    return table(head, lines)


def main(write: Callable[[str], object] = sys.stdout.write) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m capslip.studies.band", description=__doc__)
    parser.add_argument("--faces", type=int, default=20)
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--noise-nm", type=float, nargs="+", default=[5.0, 20.0])
    parser.add_argument("--hardness-Pa", type=float)
    chosen = parser.parse_args()
    found = {
        1e-9 * noise_nm: [
            one
            for seed in range(chosen.faces)
            for one in held(seed, chosen.repeats, 1e-9 * noise_nm, chosen.hardness_Pa)
        ]
        for noise_nm in chosen.noise_nm
    }
    write(f"{table_of_coverage(found)}\n")
