"""The law of a real lap joint beside published backbones: softening, damping, and their exponent.

The Brake-Reuss beam of Porter and Brake, Mech. Syst. Signal Process. 192 (2023) 110210: asperities
counted on its measured interface, and frequency and damping of its first mode over amplitude as
*their* model of rough contact gives them. The matrices of the beam are not in the data, so what is
compared needs none of it::

    1 / w^2 - 1 / w_0^2 = C delta_s / T,   zeta - zeta_0 = C w^2 W / (2 pi T^2),   T = a w^2 q

with the modal amplitude q, and C and a unknown. Their quotient W / (2 pi T delta_s) has neither: it
is the loss over the softening, of the joint alone. Here delta_s is what slip adds to the first
harmonic of the displacement under a sinusoidal force.

`python -m capslip.studies.validation FOLDER` prints the tables of `docs/validation.md`.
"""

import argparse
import json
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capslip.contact.material import Composite, composite
from capslip.contact.models.families import families
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.contact.solvers.hertz import HertzCurve, contact_radius_m
from capslip.studies.page import table

SURFACE = "brb_surface_data.mat"
BACKBONES = {"flat face": "brb_epmc_flat.yaml", "measured form": "brb_epmc_meso.yaml"}
# As the published example gives them (tmdsimpy, examples/structures/brb_epmc.py)
YOUNGS_MODULUS_PA, POISSON_RATIO, FRICTION = 192.31e9, 0.3, 0.03
YIELD_STRESS_PA = 331.7e6
AREA_M2, LOAD_N = 2.921034742767e-3, 12002.0 + 12075.0 + 12670.0
LEAST_DROP, MOST_FORCE = 5e-4, 0.98  # of the frequency; of mu N, where slip runs away
SHARES = np.geomspace(1e-3, MOST_FORCE, 240)  # of mu N


@dataclass(frozen=True, eq=False)
class Backbone:
    """A published mode over its amplitude, (n,) each."""

    amplitude: np.ndarray  # modal, of a mode normalised by mass
    frequency_rad_per_s: np.ndarray
    damping_ratio: np.ndarray

    @property
    def softening_s2(self) -> np.ndarray:
        """1 / w^2 - 1 / w_0^2: what slip adds to the modal compliance."""
        return self.frequency_rad_per_s**-2.0 - self.frequency_rad_per_s[0] ** -2.0

    @property
    def joint_damping_ratio(self) -> np.ndarray:
        """Damping ratio less that of the bodies, which is in proportion to mass."""
        w = self.frequency_rad_per_s
        return self.damping_ratio - self.damping_ratio[0] * w[0] / w

    @property
    def loss_over_softening(self) -> np.ndarray:
        """W / (2 pi T delta_s) of the joint; NaN or infinite where nothing has softened."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.joint_damping_ratio / (self.frequency_rad_per_s**2 * self.softening_s2)


@dataclass(frozen=True)
class Prediction:
    """One law beside one backbone: damping from what was fitted to the frequency alone."""

    case: str
    frequency_error: float  # rms of the softening, relative
    factor: np.ndarray  # predicted over published damping of the joint, (n,)
    force_share: np.ndarray  # T / (mu N), (n,)


def read_backbone(path: Path) -> Backbone:
    """Read lines `name : [numbers]`."""
    lines = (line.split(":", 1) for line in path.read_text(encoding="utf-8").splitlines())
    values = {name.strip(): np.array(json.loads(text)) for name, text in lines}
    names = ("modal_amplitude", "frequency_rad_per_s", "damping_factor_frac_crit")
    return Backbone(*(values[name] for name in names))


def bed(folder: Path, with_form: bool) -> HertzCurve:
    """Return the normal curve per area of the asperities, and of the gaps between their means.

    Gaps of the measured form add to the depth of every asperity: two rigid bodies, which bear on
    their highest places. Real ones bend, and bear on more.
    """
    from scipy.io import loadmat

    data = loadmat(folder / SURFACE)
    n = 400 if not with_form else 80
    x = (np.arange(n) + 0.5) / n
    weight = np.interp(x, data["normzinterp"][0], data["pzinterp"][0])
    depth_m = x * float(data["z_max"][0, 0])
    count = weight / weight.sum() * float(data["area_density"][0, 0])
    if with_form:
        gap_m = data["mesoscale_xygap"][:, 2]
        gap_m = np.quantile(gap_m[np.isfinite(gap_m)], (np.arange(200) + 0.5) / 200)
        depth_m = (depth_m[:, None] + gap_m).ravel()
        count = np.repeat(count / gap_m.size, gap_m.size)
    some = count > 0.0
    E_star_Pa = _material().E_star_Pa
    return families(count[some], float(data["Re"][0, 0]), depth_m[some], E_star_Pa)


def response_of(slip: SlipCurve) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return T / (mu N), delta_s / T and W / (2 pi T^2) of a joint, (n,) each.

    On the way back delta = delta_a - 2 delta_1((T_a - T) / 2), delta_1 the first loading; its first
    harmonic under T = T_a cos(theta) counts.
    """
    most_N = float(slip.total_slip_force_N)
    known = np.log(np.geomspace(1e-6, MOST_FORCE, 400))
    compliance = np.asarray(slip.displacement_m(np.exp(known) * most_N)) / np.exp(known)
    theta = (np.arange(90) + 0.5) * math.pi / 90
    part = 0.5 * SHARES[:, None] * (1.0 - np.cos(theta))
    back = 2.0 * part * np.interp(np.log(part), known, compliance)
    harmonic_m = -2.0 / 90 * (back * np.cos(theta)).sum(axis=1)
    T = SHARES * most_N
    slipped_m = harmonic_m - T / float(slip.tangential_stiffness_N_per_m)
    return SHARES, slipped_m / T, slip.energy_at_force_J(T) / (2.0 * math.pi * T**2)


def predict(case: str, slip: SlipCurve, backbone: Backbone) -> Prediction:
    """Fit C and a to the frequencies and predict the damping of the joint.

    Only amplitudes whose frequency has dropped by more than 5e-4 count: below, the published
    frequencies have too few digits.
    """
    share, compliance, loss = (np.log(values) for values in response_of(slip))
    w = backbone.frequency_rad_per_s
    some = w < (1.0 - LEAST_DROP) * w[0]
    force = np.log(w[some] ** 2 * backbone.amplitude[some])
    wanted = np.log(backbone.softening_s2[some])

    def rest(shift: float) -> tuple[float, float]:
        """Mean and scatter of the logarithm of C for a given a."""
        found = wanted - np.interp(force + shift, share, compliance)
        return float(found.mean()), float(found.std())

    shifts = np.linspace(share[0] - force.min(), share[-1] - force.max(), 2000)
    best = min(shifts.tolist(), key=lambda shift: rest(shift)[1])
    log_C, scatter = rest(best)
    predicted = np.exp(log_C + np.interp(force + best, share, loss)) * w[some] ** 2
    factor = predicted / backbone.joint_damping_ratio[some]
    return Prediction(case, scatter, factor, np.exp(force + best))


def exponents(backbone: Backbone) -> np.ndarray:
    """Return n of W ~ T^n between the amplitudes, (n - 1,): T goes with w^2 q."""
    force = backbone.frequency_rad_per_s**2 * backbone.amplitude
    W = 2.0 * math.pi * backbone.joint_damping_ratio * force * backbone.amplitude
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.diff(np.log(W)) / np.diff(np.log(force)))


def main(write: Callable[[str], object] = sys.stdout.write) -> None:
    """Print the tables, or why there are none."""
    parser = argparse.ArgumentParser(prog="python -m capslip.studies.validation")
    parser.add_argument("folder", type=Path, help=f"with {SURFACE} and the backbones")
    folder = parser.parse_args().folder
    missing = [name for name in (SURFACE, *BACKBONES.values()) if not (folder / name).is_file()]
    if missing:
        write(f"skipped: {folder} lacks {', '.join(missing)}\n")
        return
    write(f"{report(folder)}\n")


def report(folder: Path) -> str:
    """Return both tables in Markdown, and what the asperities bear."""
    pressure_Pa = LOAD_N / AREA_M2
    slips = {}
    for name, with_form in (("flat face", False), ("measured form", True)):
        slips[name] = slip_curve(bed(folder, with_form), pressure_Pa, FRICTION, _material().kappa)
    backbones = {name: read_backbone(folder / file) for name, file in BACKBONES.items()}
    rows: list[tuple[str, ...]] = [
        ("law, " + name, *(f"{value:.2f}" for value in _trend_of_law(slip)))
        for name, slip in slips.items()
    ]
    rows += [
        ("published, " + name, *(f"{value:.2f}" for value in _trend_of_mode(one)))
        for name, one in backbones.items()
    ]
    head = ("joint", "n at 0.1", "n at 0.5", "loss / softening at 0.1", "at 0.5", "at 0.9")
    found = [predict(name, slips[name], one) for name, one in backbones.items()]
    tried = [
        (
            one.case,
            len(one.factor),
            f"{one.force_share.min():.2f} to {one.force_share.max():.2f}",
            f"{one.frequency_error:.1%}",
            f"{np.exp(np.log(one.factor).mean()):.2f}",
            f"{one.factor.min():.2f} to {one.factor.max():.2f}",
        )
        for one in found
    ]
    columns = (
        *("joint", "amplitudes", "T / mu N", "scatter of the softening"),
        *("damping, predicted over published", "from, to"),
    )
    bears = [f"{name}: {_pressure(slip) / 1e9:.1f} GPa" for name, slip in slips.items()]
    return (
        f"{table(head, rows)}\n\n{table(columns, tried)}\n\n"
        f"Nominal pressure {pressure_Pa / 1e6:.2f} MPa; greatest pressure of an elastic asperity, "
        f"{', '.join(bears)}; yield stress {YIELD_STRESS_PA / 1e9:.2f} GPa."
    )


def _trend_of_law(slip: SlipCurve) -> tuple[float, ...]:
    share, compliance, loss = response_of(slip)
    slope = np.gradient(np.log(loss), np.log(share)) + 2.0
    n = [float(np.interp(at, share, slope)) for at in (0.1, 0.5)]
    return (*n, *(float(np.interp(at, share, loss / compliance)) for at in (0.1, 0.5, 0.9)))


def _trend_of_mode(backbone: Backbone) -> tuple[float, ...]:
    """Return the same at shares of the greatest published force in place of mu N."""
    force = backbone.frequency_rad_per_s**2 * backbone.amplitude
    share = force / force[-1]
    middle = np.sqrt(share[1:] * share[:-1])
    n = [float(np.interp(at, middle, exponents(backbone))) for at in (0.1, 0.5)]
    quotient = backbone.loss_over_softening
    return (*n, *(float(np.interp(at, share, quotient)) for at in (0.1, 0.5, 0.9)))


def _pressure(slip: SlipCurve) -> float:
    """Greatest pressure of the highest asperity, as if it stayed elastic."""
    curve = slip.curve
    N = float(curve.asperity_loads_N(slip.approach_m).max())  # type: ignore[attr-defined]
    R = float(np.max(curve.radius_m))  # type: ignore[attr-defined]
    a_m = float(contact_radius_m(N, R, _material().E_star_Pa))
    return 1.5 * N / (math.pi * a_m**2)


def _material() -> Composite:
    return composite((YOUNGS_MODULUS_PA,) * 2, (POISSON_RATIO,) * 2)


if __name__ == "__main__":
    main()
