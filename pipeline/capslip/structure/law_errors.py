"""How far the tables of a law are from the slip curves that they stand for."""

from collections.abc import Sequence

import numpy as np

from capslip.contact.scaled import ScaledCurve
from capslip.contact.slip import SlipCurve
from capslip.structure.band_state import Part
from capslip.structure.interpolation import LawTables

ASKED_SHARE = 0.1  # of mu p: what a joint is asked for
SAME_FORCE = 1e-9  # relative, of a force that comes back from its displacement


def sheared(slips: Sequence[SlipCurve], delta: np.ndarray) -> dict[str, np.ndarray]:
    """Return stiffnesses, and shear and loss at displacements (p, k), of slip curves per area."""
    pairs = list(zip(slips, delta, strict=True))
    k_n = [float(slip.curve.stiffness_N_per_m(slip.approach_m)) for slip in slips]
    return {
        "normal_stiffness_Pa_per_m": np.array(k_n),
        "tangential_stiffness_Pa_per_m": np.array(k_n) / [slip.kappa for slip in slips],
        "shear_Pa": np.array([slip.force_N(x) for slip, x in pairs]),
        "loss_J_per_m2": np.array([slip.energy_J(x) for slip, x in pairs]),
    }


def resolved_share(parts: Sequence[Part], patch: Sequence[SlipCurve]) -> float:
    """Return the share of mu p from which all scans know the loss; a tenth, if that is more."""
    shares = [ASKED_SHARE]
    for part, slip in zip(parts, patch, strict=True):
        if part.contact.rung.least_share is not None:
            curve = slip.curve.curve if isinstance(slip.curve, ScaledCurve) else slip.curve
            load_N = float(curve.load_N(slip.approach_m))
            shares.append(part.contact.rung.least_share(curve, load_N))
    return max(shares)


def errors_of_tables(
    tables: LawTables,
    slips: Sequence[SlipCurve],
    shares: np.ndarray,
    resolved: np.ndarray | float = ASKED_SHARE,
) -> np.ndarray:
    """Return the largest errors of shear, loss and stiffness before slip against their curves.

    At shares of the displacements at total slip, and halfway between them; of the loss from a
    resolved share of mu p of each curve on.

    Returns
    -------
    float64, shape (3, p)
    """
    shares = np.union1d(shares, 0.5 * (shares[1:] + shares[:-1]))
    delta = np.array([float(slip.total_slip_displacement_m) for slip in slips])[:, None] * shares
    return _errors(tables, slips, delta, resolved)


def errors_at_forces(
    tables: LawTables, slip: SlipCurve, shares: Sequence[float], resolved: float
) -> np.ndarray:
    """Return the same of one curve where it is known at shares of mu p alone, shape (3,).

    Of the loss at those that are resolved.
    """
    force_Pa = np.array(shares) * slip.total_slip_force_N
    delta = slip.displacement_m(force_Pa)[None]
    return _errors(tables, [slip], delta, min(resolved, shares[-1]) * (1.0 - SAME_FORCE))[:, 0]


def _errors(
    tables: LawTables, slips: Sequence[SlipCurve], delta: np.ndarray, resolved: np.ndarray | float
) -> np.ndarray:
    p = np.array([float(slip.preload_N) for slip in slips])[:, None]
    exact = sheared(slips, delta)
    share = exact["shear_Pa"] / (slips[0].friction_coefficient * p)
    shear = np.abs(tables.shear_Pa(delta, p) / exact["shear_Pa"] - 1.0)
    loss = np.abs(tables.loss_J_per_m2(delta, p) / exact["loss_J_per_m2"] - 1.0)
    shear = np.where(share >= ASKED_SHARE * (1.0 - SAME_FORCE), shear, 0.0)
    loss = np.where(share >= np.reshape(resolved, (-1, 1)), loss, 0.0)
    before = np.array([float(slip.tangential_stiffness_N_per_m) for slip in slips])
    stiffness = np.abs(tables.tangential_stiffness_Pa_per_m(p[:, 0]) / before - 1.0)
    return np.array((shear.max(axis=1), loss.max(axis=1), stiffness))
