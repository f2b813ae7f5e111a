"""The true answers of a case: those of its true caps, or of boundary elements on the face."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from capslip.caps.table import CapTable
from capslip.contact.balanced import rebalanced
from capslip.contact.bulk import bulk_of_face_m_per_N, without_bulk
from capslip.contact.levelling import turned
from capslip.contact.material import composite, yield_law
from capslip.contact.models.interacting import InteractingCurve, interacting
from capslip.contact.rung import load_point_m
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.contact.solvers.yielding import first_loading
from capslip.errors import TipsOverError
from capslip.settings import Settings
from capslip.studies.faces.synthetic import Truth, synthetic_surface
from capslip.studies.limits.case import Case, clean
from capslip.studies.limits.of_face import OfFace, answers_of_face
from capslip.surface.heightmap import HeightMap

CUBIC_BELOW = 1e-3  # share of total slip below which the energy follows the cube of the force
SETTLED, LEAST_TURN = 1e-9, 1e-12  # of the slope that balances the true caps, and that slope


@dataclass(frozen=True)
class Known:
    """The true answers of a case; NaN where there is none."""

    values: dict[str, float]
    uncertainty: float  # relative, of each
    counts: tuple[int, int] | None  # m and n, None where the face has no families
    pressure_Pa: float | None = None  # greatest true pressure, where the truth is caps


def known_answers(case: Case, settings: Settings, solved: dict[Any, OfFace]) -> Known:
    """Return the truth: that of the true caps where the face has nothing else, or of the face.

    Parameters
    ----------
    case, settings : Case, Settings
        The face, its load, its material, and whether it is balanced.
    solved : dict
        What boundary elements found on faces that several cases share; new ones are added.

    Raises
    ------
    ContactError
        If boundary elements find no answer.
    """
    scene = clean(case.scene)
    caps_alone = case.face_change is None and not scene.caps and not scene.waviness_rms_m
    face, truth = synthetic_surface(scene, case.name)
    counts = None
    if truth.family.size and (truth.family != "").all():
        counts = (int((truth.family == "G").sum()), int((truth.family == "P").sum()))
    if caps_alone and not scene.roughness_rms_m:
        known = _known_of_caps(case, truth, face, settings, counts)
        if known is not None:
            return known
    key = (scene, case.face_change, case.preload_N, case.shares, settings.contact.alignment)
    if key not in solved:
        solved[key] = answers_of_face(case, settings)
    found = solved[key]
    names = ("approach", "stiffness", *energy_names(case.shares))
    answers = (found.approach_m, found.stiffness_N_per_m, *found.energy_J)
    return Known(
        values=dict(zip(names, answers, strict=True)),
        uncertainty=found.uncertainty,
        counts=counts,
    )


def energy_names(shares: tuple[float, ...]) -> tuple[str, ...]:
    """Return the names of the energies at these shares of mu N."""
    return tuple(f"energy at {share:g} mu N" for share in shares)


def _known_of_caps(
    case: Case,
    truth: Truth,
    face: HeightMap,
    settings: Settings,
    counts: tuple[int, int] | None,
) -> Known | None:
    """Return the answers of the true caps; None where they are not all that touches."""
    preload_N = case.preload_N
    found = slip_of_true_caps(truth, face, settings, preload_N)
    if found is None:
        return None
    curve, slip = found
    approach_m = float(curve.approach_m(preload_N))
    load_N = curve.asperity_loads_N(approach_m)
    a_m = contact_radius_m(load_N, curve.radius_m, curve.E_star_Pa)
    touching = load_N > 0.0
    bulk_m_per_N = bulk_of_face_m_per_N(face, curve.E_star_Pa)
    # Far below total slip the cube law holds: an answer that does not hang on small differences.
    shares = np.array(case.shares)
    solved = np.maximum(shares, CUBIC_BELOW)
    energies_J = slip.energy_at_force_J(solved * slip.total_slip_force_N) * (shares / solved) ** 3
    return Known(
        values={
            "approach": approach_m - bulk_m_per_N * preload_N,
            "stiffness": float(slip.tangential_stiffness_N_per_m),
            **dict(zip(energy_names(case.shares), energies_J.tolist(), strict=True)),
        },
        uncertainty=0.0,
        counts=counts,
        pressure_Pa=float((1.5 * load_N[touching] / (np.pi * a_m[touching] ** 2)).max()),
    )


def slip_of_true_caps(
    truth: Truth, face: HeightMap, settings: Settings, preload_N: float
) -> tuple[InteractingCurve, SlipCurve] | None:
    """Return the true caps with interaction, balanced, and their slip without the bulk sinking.

    None where they are not all that touches.
    """
    material = settings.material
    joint = composite(material.youngs_modulus_Pa, material.poisson_ratio)
    places, peak_m = (truth.x_m, truth.y_m), truth.peak_height_m
    if settings.contact.alignment == "balanced":
        found = _balanced(truth, face, settings)
        if found is None:
            return None
        level, floor_m = found
        places, peak_m = (level.x_m, level.y_m), level.peak_height_m
    spheres = truth.radius_m, peak_m.max() - peak_m
    curve = interacting(*spheres, *places, joint.E_star_Pa, preload_N)
    law = yield_law(material)
    if law is not None:
        after = first_loading(
            *(law, *spheres, joint.E_star_Pa, preload_N),
            compliance_m_per_N=curve.pair_compliance_m_per_N,
            near=curve.near,
        )
        spheres, start_m = (after.radius_m, after.depth_m), after.compression_m
        curve = interacting(*spheres, *places, joint.E_star_Pa, preload_N, start_m=start_m)
    approach_m = float(curve.approach_m(preload_N))
    if curve.overlapping_pairs(approach_m):
        return None
    if settings.contact.alignment == "balanced" and floor_m > peak_m.max() - approach_m:
        return None
    bulk_m_per_N = bulk_of_face_m_per_N(face, joint.E_star_Pa)
    rest, _ = without_bulk(curve, bulk_m_per_N, preload_N)
    return curve, slip_curve(rest, preload_N, material.friction_coefficient, joint.kappa)


def _balanced(truth: Truth, face: HeightMap, settings: Settings) -> tuple[CapTable, float] | None:
    """Return the true caps over the plane that balances them, and the highest of the floor.

    A face that turns by s touches its spheres elsewhere, by R s: at R = 24 m and 3 um/m by 70 um,
    which moves the balance again, and the energies by up to 10 %.

    None where the caps alone cannot be balanced: the face tips over until its floor touches. Where
    they stand nearly on one line, a turn moves their places more than their loads, and turn after
    turn would swing.
    """
    from scipy.optimize import root

    at_m = load_point_m(face, settings)
    everywhere = np.ones(len(truth.x_m), dtype=bool)

    def turn(slope: np.ndarray) -> np.ndarray:
        table = _turned_caps(truth, slope, at_m)
        level, _ = rebalanced(table, table, everywhere, at_m, settings)
        arm_m = np.column_stack((table.x_m - at_m[0], table.y_m - at_m[1]))
        up_m = level.peak_height_m - table.peak_height_m
        return np.asarray(np.linalg.lstsq(arm_m, up_m, rcond=None)[0])

    try:
        first = turn(np.zeros(2))
        unit = max(float(np.abs(first).max()), LEAST_TURN)
        solved = root(lambda turns: turn(unit * turns) / unit, first / unit, tol=SETTLED)
    except TipsOverError:
        return None
    if not solved.success:
        return None
    slope = unit * solved.x
    floor = face.height_m <= face.height_m.min() + 1e-12
    level = _turned_caps(truth, slope, at_m)
    return level, float(turned(face, slope, at_m).height_m[floor].max())


def _turned_caps(truth: Truth, slope: np.ndarray, at_m: tuple[float, float]) -> CapTable:
    """Return the true spheres where they are highest over a plane that a slope was added to."""
    unknown = np.full(len(truth.x_m), np.nan)
    arm_m = np.column_stack((truth.x_m - at_m[0], truth.y_m - at_m[1]))
    return CapTable(
        x_m=truth.x_m + truth.radius_m * slope[0],
        y_m=truth.y_m + truth.radius_m * slope[1],
        peak_height_m=truth.peak_height_m + arm_m @ slope + 0.5 * truth.radius_m * (slope @ slope),
        cap_height_m=unknown,
        diameter_m=unknown,
        radius_m=truth.radius_m,
        area_m2=unknown,
        residual_m=unknown,
        family=truth.family,
        load_N=unknown,
        contact_radius_m=unknown,
        flags=np.zeros(len(truth.x_m), dtype=np.uint16),
    )
