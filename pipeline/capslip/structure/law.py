"""The law of a joint face for a structure: stiffness, shear and loss per area, over pressure."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from capslip.contact.joint import MAX_SOLVED, Joint, curve_of_joint
from capslip.contact.press import ContactState
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.errors import ContactError
from capslip.structure.interpolation import ROWS, tables_of
from capslip.structure.jenkins import JenkinsElements, jenkins

# Pressures lie at p0 times ratio^i, so that the pressure of the scan is one of them.
RATIO, BELOW, ABOVE = 10 ** (1 / 8), 16, 4  # p0 / 100 to 3.2 p0
RATIO_SOLVED, BELOW_SOLVED = 10 ** (1 / 5), 5  # p0 / 10 to 2.5 p0, each solved on the map
ABOVE_SOLVED = MAX_SOLVED - 1 - BELOW_SOLVED
# Of a face that yields each pressure has a curve of its own, and caps touch in between
RATIO_YIELDED, BELOW_YIELDED, ABOVE_YIELDED = 10 ** (1 / 16), 32, 8
SHARES = np.union1d(np.geomspace(1e-3, 0.5, 36), 1.0 - np.append(np.geomspace(0.46, 1e-2, 12), 0.0))
POINTS, LEAST_LOAD = 800, 1e-4  # of the bed of springs; of the load of the scan
BED = ("friction_coefficient", "kappa", "range_Pa", "bed_closure_m", "bed_stiffness_Pa_per_m")
JENKINS_TOLERANCE = 0.02
ASKED_SHARE = 0.1  # of mu p: what a joint is asked for


@dataclass(frozen=True, eq=False)
class Law:
    """A joint face per nominal area; p pressures, k displacements, q closures.

    What is not in it: turning, normal load that varies in the cycle, slip in two directions, memory
    of a higher pressure.
    """

    pressure_Pa: np.ndarray  # (p,), growing
    closure_m: np.ndarray  # (p,), approach from first touch, without what yielded
    normal_stiffness_Pa_per_m: np.ndarray  # (p,)
    tangential_stiffness_Pa_per_m: np.ndarray  # (p,), before slip
    total_slip_displacement_m: np.ndarray  # (p,)
    displacement_m: np.ndarray  # (p, k), to total slip
    shear_Pa: np.ndarray  # (p, k), tau on first loading
    loss_J_per_m2: np.ndarray  # (p, k), w of a cycle
    bed_closure_m: np.ndarray | None  # (q,), from 0: see `LawTables`; None where the face yields
    bed_stiffness_Pa_per_m: np.ndarray | None  # (q,)
    elements: tuple[JenkinsElements, ...]  # p, per area: N is N/m^2 in them
    friction_coefficient: float
    kappa: float
    scan_pressure_Pa: float  # under which the scan was analysed
    area_m2: float  # of the scan
    ends: str  # why the pressures end where they do
    holds_bulk: bool  # whether the sinking of a half-space of the scan's size is in it
    solved: bool  # whether the model solves the map for each pressure
    hardness_Pa: float | None  # None: all is elastic, and one bed serves all pressures
    model: str
    model_error: float | None  # of energy and stiffness at the pressure of the scan
    shear_error: float  # of `LawTables`, from a tenth of mu p on, see `law`
    loss_error: float

    @property
    def range_Pa(self) -> tuple[float, float]:
        """Least and greatest pressure."""
        return float(self.pressure_Pa[0]), float(self.pressure_Pa[-1])

    def tables(self) -> dict[str, Any]:
        """Return what `LawTables` reads."""
        names = BED if self.hardness_Pa is None else (*BED[:3], *ROWS)
        return {name: getattr(self, name) for name in names}

    @property
    def at_scan_pressure(self) -> int:
        """Index of the pressure under which the scan was analysed."""
        return int(np.argmin(np.abs(np.log(self.pressure_Pa / self.scan_pressure_Pa))))


def law(
    contact: ContactState,
    joint: Joint,
    friction_coefficient: float,
    reach_m: float | None = None,
) -> Law:
    """Return the law per nominal area around the pressure under which a scan was analysed.

    A patch under another pressure is the same normal curve at another load, so with the area A of
    the scan and its curve N(d)::

        p = N(d) / A,  k_n = N'(d) / A,  k_t = k_n / kappa
        tau(delta, p) = mu [N(d) - N(d - e)] / A,  e = delta / (mu kappa),  w likewise by Masing

    A face that yields is loaded to each pressure once, and N(d) is the curve along which it unloads
    from there: each pressure has its own. A model that solves the map anew for each load gets at
    most `MAX_SOLVED` pressures.

    Parameters
    ----------
    contact : ContactState
        The scan under its share of the load.
    joint : Joint
        What the scan is a part of.
    friction_coefficient : float
        mu.
    reach_m : float, optional
        How far below the highest peak all that may touch is a cap of the curve. Pressures above
        that of the scan end where the approach gets there.

    Raises
    ------
    ContactError
        If no scanned area is known, or a curve cannot carry the lower pressures.

    Notes
    -----
    The errors of what lies between the points of the tables are the largest at `pressure_Pa`, from
    a tenth of mu p on; where each pressure has a solution or a curve of its own, with every second
    one left out.

    Slip: Eqs. 3-16 of Peyret, Chevallier and Dion, Int. J. Appl. Mech. 8 (2016) 1650097, see
    `contact.slip`. The tilt of the face is that under the pressure of the scan.
    """
    area_m2 = joint.scan_area_m2
    if area_m2 is None:
        raise ContactError("it is a law per area, which needs a scanned area")
    slips, ends = _slip_curves(contact, joint, area_m2, friction_coefficient, reach_m)
    solved = contact.rung.solved_loads_N is not None
    D = np.array([float(slip.total_slip_displacement_m) for slip in slips])
    delta = D[:, None] * SHARES
    k_n = [float(slip.curve.stiffness_N_per_m(slip.approach_m)) for slip in slips]
    rows: dict[str, Any] = {
        "pressure_Pa": np.array([float(slip.preload_N) for slip in slips]),
        "closure_m": np.array([float(slip.approach_m - slip.curve.touch_m) for slip in slips]),
        "normal_stiffness_Pa_per_m": np.array(k_n),
        "displacement_m": delta,
        "shear_Pa": np.array([slip.force_N(x) for slip, x in zip(slips, delta, strict=True)]),
        "loss_J_per_m2": np.array([slip.energy_J(x) for slip, x in zip(slips, delta, strict=True)]),
    }
    kappa = contact.composite.kappa
    of_law = (friction_coefficient, kappa, rows["pressure_Pa"][[0, -1]])
    tables = dict(zip(BED, of_law, strict=False))
    # What lies between the pressures is measured at those that are left out
    some = np.union1d(np.arange(0, len(slips), 2), len(slips) - 1)
    bed: tuple[np.ndarray | None, np.ndarray | None] = (None, None)
    if contact.hardness_Pa is not None:
        tables |= {name: rows[name][some] for name in ROWS}
    elif solved:
        bed = _bed_of_solutions(rows, np.arange(len(slips)))
        tables |= dict(zip(BED[3:], _bed_of_solutions(rows, some), strict=True))
    else:
        bed = _bed_of_curve(slips[-1], joint, area_m2)
        tables |= dict(zip(BED[3:], bed, strict=True))
    shear_error, loss_error = _error_of_tables(tables, rows, friction_coefficient)
    return Law(
        **rows,
        tangential_stiffness_Pa_per_m=rows["normal_stiffness_Pa_per_m"] / kappa,
        total_slip_displacement_m=D,
        bed_closure_m=bed[0],
        bed_stiffness_Pa_per_m=bed[1],
        elements=tuple(jenkins(slip, JENKINS_TOLERANCE) for slip in slips),
        friction_coefficient=friction_coefficient,
        kappa=kappa,
        scan_pressure_Pa=joint.scan_load_N / area_m2,
        area_m2=area_m2,
        ends=ends,
        holds_bulk=contact.bulk,
        solved=solved,
        hardness_Pa=contact.hardness_Pa,
        model=contact.model,
        model_error=contact.estimated_error,
        shear_error=shear_error,
        loss_error=loss_error,
    )


def _slip_curves(
    contact: ContactState,
    joint: Joint,
    area_m2: float,
    friction_coefficient: float,
    reach_m: float | None,
) -> tuple[list[SlipCurve], str]:
    """Return slip curves per area under growing pressures, and why they end."""
    solves = contact.rung.solved_loads_N is not None
    ratio, below, above = RATIO, BELOW, ABOVE
    if contact.hardness_Pa is not None:
        ratio, below, above = RATIO_YIELDED, BELOW_YIELDED, ABOVE_YIELDED
    if solves:
        ratio, below, above = RATIO_SOLVED, BELOW_SOLVED, ABOVE_SOLVED
    caps_end_m = reach_m if contact.rung.made_from == "spheres" else None
    slips: list[SlipCurve] = []
    for i in range(-below, above + 1):
        load_N = joint.scan_load_N * ratio**i
        try:
            curve = contact.curve if i == 0 else contact.curve_after(load_N)
            per_area = curve_of_joint(curve, np.array([load_N]), np.array([1.0 / area_m2]))
            slip = slip_curve(
                per_area, load_N / area_m2, friction_coefficient, contact.composite.kappa
            )
        except ContactError as error:
            if i <= 0:
                raise
            return slips, f"the model carries no more: {error}"
        if i > 0 and caps_end_m is not None and float(slip.approach_m) > caps_end_m:
            return slips, (
                f"under more than this the face closes by more than {caps_end_m:.3g} m, below "
                "which no cap of the curve stands for what may touch; analyse the scan at a higher "
                "pressure for more"
            )
        slips.append(slip)
    few = f"{MAX_SOLVED} pressures, as each is solved on the whole map, " if solves else ""
    return slips, f"{few}{ratio**above:.2g} times the pressure of the scan"


def _bed_of_curve(
    highest: SlipCurve, joint: Joint, area_m2: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return closures and stiffnesses of the whole curve up to the highest pressure."""
    curve = highest.curve
    least_Pa = LEAST_LOAD * joint.scan_load_N / area_m2
    p = np.geomspace(least_Pa, float(highest.preload_N), POINTS)
    approach_m = np.asarray(curve.approach_m(p))
    K = np.asarray(curve.stiffness_N_per_m(approach_m))
    return _from_touch(p, approach_m - float(curve.touch_m), K)


def _bed_of_solutions(rows: dict[str, Any], of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return them between solved pressures: a cubic in log-log with their closures and slopes."""
    from scipy.interpolate import CubicHermiteSpline

    names = ("pressure_Pa", "closure_m", "normal_stiffness_Pa_per_m")
    p, d, K = (rows[name][of] for name in names)
    curve = CubicHermiteSpline(np.log(p), np.log(d), p / (K * d))
    fine = np.linspace(np.log(p[0]), np.log(p[-1]), POINTS)
    z = np.exp(curve(fine))
    # Below the least pressure the power law that its closure and slope make
    exponent = p[0] / (K[0] * d[0])
    below = np.geomspace(LEAST_LOAD * p[-1], p[0], POINTS // 2, endpoint=False)
    z_below = d[0] * (below / p[0]) ** exponent
    all_p, all_z = np.append(below, np.exp(fine)), np.append(z_below, z)
    slope = np.append(np.full(below.size, exponent), curve(fine, 1))
    return _from_touch(all_p, all_z, all_p / (slope * all_z))


def _from_touch(p: np.ndarray, z: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add the touch, with the springs there that bear the first pressure."""
    at_touch = max(2.0 * p[0] / z[0] - K[0], 0.0)
    return np.append(0.0, z), np.append(at_touch, K)


def _error_of_tables(
    of: dict[str, Any], rows: dict[str, Any], friction_coefficient: float
) -> tuple[float, float]:
    """Return the largest errors of shear and loss against the slip curves they stand for."""
    tables = tables_of(of)
    p, delta = rows["pressure_Pa"][:, None], rows["displacement_m"]
    asked = rows["shear_Pa"] >= ASKED_SHARE * friction_coefficient * p
    shear = np.abs(tables.shear_Pa(delta, p) / rows["shear_Pa"] - 1.0)
    loss = np.abs(tables.loss_J_per_m2(delta, p) / rows["loss_J_per_m2"] - 1.0)
    return float(shear[asked].max()), float(loss[asked].max())
