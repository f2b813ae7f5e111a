"""What the chart compares: the numbers of one analysis, and those of the reference."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from capslip.contact.bulk import bulk_compliance_m_per_N, without_bulk
from capslip.contact.material import composite
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.polonsky_keer import Certificate, Pressed, press
from capslip.settings import Settings
from capslip.structure.response import response
from capslip.structure.stiffness import stiffnesses
from capslip.surface.heightmap import HeightMap

if TYPE_CHECKING:
    from capslip.result import Analysis

FORCE_SHARES = (0.1, 0.25, 0.5, 0.75)  # T / (mu N) at which the energy is compared
ENERGIES = tuple(f"energy_{share:g}" for share in FORCE_SHARES)
QUANTITIES = (
    "approach",
    "approach_without_bulk",
    "stiffness",
    "stiffness_without_bulk",
    *ENERGIES,
    "peak_loss_factor",
)
TOLERANCE = 1e-8  # of the solutions of the reference
# Relative error of the energy times the width, in pixels, of the ring around each contact that
# leaves it: the most that was seen on equal spheres from 300 x 200 to 1200 x 800 points.
RING_ERROR = 0.035
STIFFNESS_ERROR = 0.002  # seen on the same


@dataclass(frozen=True)
class Reference:
    """The reference answer on one face at one load.

    `numbers` has an entry for each of `QUANTITIES`, None where it does not exist; the energies
    come from one solution each, the peak of the loss factor from the interpolated unloading.
    """

    numbers: dict[str, float | None]
    uncertainty: dict[str, float]  # relative, of energies and stiffness
    certificate: Certificate  # the worst of all solutions
    pixels_across: float  # of the contacts that carry half of the load
    contacts: int
    loss_error: float | None  # of what lies between the solved loads, so of the peak


def reference(face: HeightMap, settings: Settings, *, with_peak: bool = True) -> Reference:
    """Press a conditioned face with boundary elements.

    The energy of a cycle at the force T follows from the states at N and N - T / mu alone, by
    Betti's theorem (see `unload`), so no curve is interpolated.

    Raises
    ------
    ContactError
        If a solution is not found, or the contact has too few pixels.
    """
    material, preload_N = settings.material, settings.contact.preload_N
    joint = composite(material.youngs_modulus_Pa, material.poisson_ratio)
    mu, kappa = material.friction_coefficient, joint.kappa
    curve = boundary_elements(face, joint.E_star_Pa, TOLERANCE)
    loaded = curve.pressed(preload_N)
    bulk_m_per_N = bulk_compliance_m_per_N(face.side_m, joint.E_star_Pa)
    lower = [
        press(
            curve.solutions.face,
            load_N=(1.0 - share) * preload_N,
            tolerance=TOLERANCE,
            start_Pa=(1.0 - share) * loaded.pressure_Pa,
        )
        for share in FORCE_SHARES
    ]
    numbers: dict[str, float | None] = {
        "approach": loaded.approach_m,
        "approach_without_bulk": loaded.approach_m - bulk_m_per_N * preload_N,
        "stiffness": float(curve.stiffness_N_per_m(loaded.approach_m)) / kappa,
        "stiffness_without_bulk": None,
        "peak_loss_factor": None,
    }
    rest, with_bulk = without_bulk(curve, bulk_m_per_N, preload_N)
    if not with_bulk:
        stiffness_N_per_m = rest.stiffness_N_per_m(rest.approach_m(preload_N))
        numbers["stiffness_without_bulk"] = float(stiffness_N_per_m) / kappa
    uncertainty = dict.fromkeys(("stiffness", "stiffness_without_bulk"), STIFFNESS_ERROR)
    for name, state in zip(ENERGIES, lower, strict=True):
        # Zero: less than one pixel slips, and the map does not tell
        numbers[name] = mu**2 * kappa * _loss_J(loaded, state) or None
        uncertainty[name] = RING_ERROR / _ring_pixels(loaded, state)
    loss_error = None
    if with_peak:
        _, modal, own = stiffnesses(settings)
        slip = slip_curve(curve, preload_N, mu, kappa)
        damping = response(slip, modal, own, settings.structure.joints)
        numbers["peak_loss_factor"] = damping.peak_loss_factor or None
        loss_error = curve.unloading(preload_N).loss_error
    return Reference(
        numbers=numbers,
        uncertainty=uncertainty,
        certificate=_worst([state.certificate for state in (loaded, *lower)]),
        pixels_across=loaded.pixels_across,
        contacts=len(loaded.region_pixels),
        loss_error=loss_error,
    )


def numbers_of(analysis: "Analysis") -> dict[str, float | None]:
    """Return the numbers of an analysis that `reference` has too; None where there are none."""
    contact, slip, damping = analysis.contact, analysis.slip, analysis.damping
    if contact is None or slip is None or damping is None:
        return dict.fromkeys(QUANTITIES)
    normal_N_per_m = float(contact.normal.stiffness_N_per_m(contact.approach_m))
    force_N = np.array(FORCE_SHARES) * slip.total_slip_force_N
    values = {
        "approach": contact.approach_m,
        "approach_without_bulk": contact.approach_without_bulk_m,
        "stiffness": normal_N_per_m / slip.kappa,
        "stiffness_without_bulk": None if contact.bulk else slip.tangential_stiffness_N_per_m,
        "peak_loss_factor": damping.peak_loss_factor,
        **dict(zip(ENERGIES, slip.energy_at_force_J(force_N).tolist(), strict=True)),
    }
    return {name: _finite(values[name]) for name in QUANTITIES}


def _loss_J(loaded: Pressed, state: Pressed) -> float:
    dy_m, dx_m = loaded.pixel_size_m
    gap_m = np.where(state.pressure_Pa > 0.0, 0.0, np.maximum(state.gap_m, 0.0))
    return float(4.0 * (loaded.pressure_Pa * gap_m).sum() * dy_m * dx_m)


def _ring_pixels(loaded: Pressed, state: Pressed) -> float:
    """Return the mean width of what leaves the contacts, over their circumference."""
    n_left = np.count_nonzero(loaded.pressure_Pa) - np.count_nonzero(state.pressure_Pa)
    return float(max(n_left, 1) / (2.0 * np.sqrt(np.pi * loaded.region_pixels)).sum())


def _worst(certificates: list[Certificate]) -> Certificate:
    rows = [asdict(one) for one in certificates]
    lower = ("least_gap", "least_pressure")
    return Certificate(
        **{name: (min if name in lower else max)(row[name] for row in rows) for name in rows[0]}
    )


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None
