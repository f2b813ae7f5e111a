"""What the chart compares: the numbers of one analysis, and those of the reference."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from capslip.contact.bulk import bulk_of_face_m_per_N, without_bulk
from capslip.contact.map_curve import BoundaryElementCurve
from capslip.contact.material import composite
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.rung import load_point_m, turning_stiffness
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
PROOF_SHARE = 0.5  # T / (mu N) at which the whole map proves what patches say
# Relative error of the energy times the width, in pixels, of the ring around each contact that
# leaves it: the most that was seen on equal spheres from 300 x 200 to 1200 x 800 points.
RING_ERROR = 0.035
SMALLEST_ERROR = 0.05  # relative error of the energy at `Unloading.smallest_drop_N`
STIFFNESS_ERROR = 0.002  # seen on the same spheres


@dataclass(frozen=True)
class Reference:
    """The reference answer on one face at one load.

    `numbers` has an entry for each of `QUANTITIES`, None where it does not exist.
    """

    numbers: dict[str, float | None]
    uncertainty: dict[str, float]  # relative, of energies and stiffness
    certificate: Certificate  # the worst of two solutions on the whole map
    patch_error: float  # what patches leave out of the unloading, over the approach
    proof_error: float  # of the energy at `PROOF_SHARE`, beyond what pixels leave
    pixels_across: float  # of the contacts that carry half of the load
    contacts: int
    loss_error: float  # between the solved loads, relative


def reference(face: HeightMap, settings: Settings, *, with_peak: bool = True) -> Reference:
    """Press a conditioned face with boundary elements, balanced or as levelled.

    The energies are those of the unloading on patches around the contacts, refined where these are
    narrow. One state below the preload is solved on the whole map, too: its energy follows from it
    and the loaded one alone, by Betti's theorem (see `unload`), and what both ways differ by beyond
    the error of the pixels is added to the uncertainty.

    Parameters
    ----------
    face : HeightMap
        Heights after removal of the form.
    settings : Settings
        `material`, `contact` with its alignment, and `structure` for the peak.
    with_peak : bool
        Whether to find the peak of the loss factor.

    Raises
    ------
    ContactError
        If a solution is not found, the face tips over, or the contact has too few pixels.
    """
    material, preload_N = settings.material, settings.contact.preload_N
    joint = composite(material.youngs_modulus_Pa, material.poisson_ratio)
    mu, kappa = material.friction_coefficient, joint.kappa
    curve = _curve(face, joint.E_star_Pa, settings)
    loaded, unloading = curve.pressed(preload_N), curve.unloading(preload_N)
    slip = slip_curve(curve, preload_N, mu, kappa)
    bulk_m_per_N = bulk_of_face_m_per_N(face, joint.E_star_Pa)
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
    proof = press(
        curve.solutions.face,
        load_N=(1.0 - PROOF_SHARE) * preload_N,
        tolerance=TOLERANCE,
        start_Pa=(1.0 - PROOF_SHARE) * loaded.pressure_Pa,
    )
    proven_J = mu**2 * kappa * _loss_J(loaded, proof)
    found_J = float(slip.energy_at_force_J(PROOF_SHARE * slip.total_slip_force_N))
    off = abs(proven_J / found_J - 1.0) if found_J else 0.0
    pixel_error = RING_ERROR / _ring_pixels(loaded, proof)
    proof_error = max(0.0, off - pixel_error)
    uncertainty = dict.fromkeys(("stiffness", "stiffness_without_bulk"), STIFFNESS_ERROR)
    smallest = SMALLEST_ERROR * unloading.smallest_drop_N / preload_N
    for name, share in zip(ENERGIES, FORCE_SHARES, strict=True):
        # Zero: less than one pixel slips, and the map does not tell
        numbers[name] = float(slip.energy_at_force_J(share * slip.total_slip_force_N)) or None
        uncertainty[name] = unloading.loss_error + smallest / share + proof_error
        if share == PROOF_SHARE:  # the proven energy is no further off than its pixels make it
            uncertainty[name] = min(uncertainty[name], off + pixel_error)
    if with_peak:
        _, modal, own = stiffnesses(settings)
        damping = response(slip, modal, own, settings.structure.joints)
        numbers["peak_loss_factor"] = damping.peak_loss_factor or None
    return Reference(
        numbers=numbers,
        uncertainty=uncertainty,
        certificate=_worst([loaded.certificate, proof.certificate]),
        patch_error=unloading.patch_error,
        proof_error=proof_error,
        pixels_across=loaded.pixels_across,
        contacts=len(loaded.region_pixels),
        loss_error=unloading.loss_error,
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


def _curve(face: HeightMap, E_star_Pa: float, settings: Settings) -> BoundaryElementCurve:
    if settings.contact.alignment == "as_levelled":
        return boundary_elements(face, E_star_Pa, TOLERANCE)
    return boundary_elements(
        face,
        E_star_Pa,
        TOLERANCE,
        preload_N=settings.contact.preload_N,
        balanced=True,
        load_point_m=load_point_m(face, settings),
        rotational_stiffness_Nm_per_rad=turning_stiffness(settings),
    )


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
    worst = {name: (min if name in lower else max)(row[name] for row in rows) for name in rows[0]}
    return Certificate(**{**worst, "moments": certificates[0].moments})


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None
