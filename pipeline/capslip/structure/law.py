"""The law of a joint face for a structure: stiffness, shear and loss per area, over pressure."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from capslip.contact.joint import MAX_SOLVED, Joint, curve_of_joint
from capslip.contact.scans import joint_of_scans
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.errors import ContactError, SettingsError, check_call, check_kind
from capslip.structure.band_causes import NORMAL_95
from capslip.structure.band_state import Part
from capslip.structure.beds import (
    LEAST_LOAD,
    bed_of_curve,
    bed_of_solutions,
    beds_at_loads,
    beds_between,
    closure_together_m,
    kappa_of,
    serves_all,
)
from capslip.structure.interpolation import BED, OF_JOINT, tables_of
from capslip.structure.jenkins import JenkinsElements, jenkins
from capslip.structure.law_errors import (
    errors_at_forces,
    errors_of_tables,
    resolved_share,
    sheared,
)

# Pressures lie at p0 times ratio^i, so that the pressure of the scan is one of them.
RATIO, BELOW, ABOVE = 10 ** (1 / 8), 16, 4  # p0 / 100 to 3.2 p0
RATIO_SOLVED, BELOW_SOLVED = 10 ** (1 / 5), 5  # p0 / 10 to 2.5 p0, each solved on the map
ABOVE_SOLVED = MAX_SOLVED - 1 - BELOW_SOLVED
# Where each pressure has a curve of its own; contacts touch in between
RATIO_OF_OWN, BELOW_OF_OWN, ABOVE_OF_OWN = 10 ** (1 / 16), 32, 8
MOST_TURNS, BETWEEN = 4, 0.05  # in which pressures are added, where more is missing than that
SHARES = np.union1d(np.geomspace(1e-3, 0.5, 36), 1.0 - np.append(np.geomspace(0.46, 1e-2, 12), 0.0))
# Each of several scans slips as a whole at a share of its own
SHARES_OF_SCANS = np.union1d(SHARES, np.geomspace(0.05, 1.0, 80))
JENKINS_TOLERANCE = 0.02
# Columns that hold how much the scans of a joint differ
SCATTERS = {
    "normal_stiffness_Pa_per_m": "normal_stiffness_scatter_Pa_per_m",
    "tangential_stiffness_Pa_per_m": "tangential_stiffness_scatter_Pa_per_m",
    "shear_Pa": "shear_scatter_Pa",
    "loss_J_per_m2": "loss_scatter_J_per_m2",
}
# Of mu p, at which maps are measured between pressures; elsewhere errors may be so much more
FORCES_BETWEEN = (0.1, 0.12, 0.145, 0.175, 0.21, 0.25, 0.3, 0.36, 0.45, 0.6, 0.8)
ELSEWHERE = 1.2
MOST_UNLIKE = 2  # intervals with the largest errors halfway, that are measured at their quarters


@dataclass(frozen=True, eq=False)
class Law:
    """A joint face per nominal area; p pressures, k displacements.

    What is not in it: turning, normal load that varies in the cycle, slip in two directions, memory
    of a higher pressure.
    """

    pressure_Pa: np.ndarray  # (p,), growing
    closure_m: np.ndarray  # (p,), from first touch, without what yielded
    normal_stiffness_Pa_per_m: np.ndarray  # (p,)
    tangential_stiffness_Pa_per_m: np.ndarray  # (p,), before slip
    total_slip_displacement_m: np.ndarray  # (p,)
    displacement_m: np.ndarray  # (p, k), to total slip
    shear_Pa: np.ndarray  # (p, k), tau on first loading
    loss_J_per_m2: np.ndarray  # (p, k), w of a cycle
    scatter: dict[str, np.ndarray]  # standard deviation between scans, by `SCATTERS`; {}: one scan
    of_scans: tuple[dict[str, Any], ...]  # what `tables_of` takes of each scan, and its share
    elements: tuple[JenkinsElements, ...]  # p, per area: N is N/m^2 in them
    friction_coefficient: float
    kappa: float
    scan_pressure_Pa: float  # under which the scans were analysed
    scans: int
    area_m2: float  # of all scans
    finds_levels: bool  # whether a scan turns to the level of each pressure
    no_level_Pa: tuple[float, ...]  # pressures that find none: there it lies as it was analysed
    ends: str  # why the pressures end where they do
    holds_bulk: bool  # whether the sinking of a half-space of the scan's size is in it
    hardness_Pa: float | None  # None: all is elastic
    model: str
    model_error: float | None  # of energy and stiffness at the pressure of the scan
    halfway: bool  # whether the next three are measured halfway between pressures, solved there
    shear_error: float  # of `LawTables`, from a tenth of mu p on, see `law`; infinite: not known
    loss_error: float  # from `resolved_share` on
    stiffness_error: float  # before any slip; infinite: not known
    resolved_share: np.ndarray  # (p,), of mu p: a tenth, or what the pixels of a map resolve

    @property
    def range_Pa(self) -> tuple[float, float]:
        """Least and greatest pressure."""
        return float(self.pressure_Pa[0]), float(self.pressure_Pa[-1])

    def tables(self) -> dict[str, Any]:
        """Return what `tables_of` takes."""
        return _tables({name: getattr(self, name) for name in OF_JOINT}, self.of_scans)

    @property
    def has_beds_alone(self) -> bool:
        """Whether one bed of springs of each scan serves every pressure."""
        return all(map(_has_one_bed, self.of_scans))

    @property
    def at_scan_pressure(self) -> int:
        """Index of the pressure under which the scans were analysed."""
        return int(np.argmin(np.abs(np.log(self.pressure_Pa / self.scan_pressure_Pa))))


def law(
    parts: Sequence[Part],
    friction_coefficient: float,
    holds: Callable[[float], bool] | None = None,
) -> Law:
    """Return the law per nominal area around the pressure under which scans were analysed.

    A patch under another pressure is the same normal curve at another load, so with the area A of
    the scan and its curve N(d)::

        p = N(d) / A,  k_n = N'(d) / A,  k_t = k_n / kappa
        tau(delta, p) = mu [N(d) - N(d - e)] / A,  e = delta / (mu kappa),  w likewise by Masing

    A face in balance lies under each pressure at the level that this one finds, and one that yields
    is loaded to each pressure once, and N(d) is the curve along which it unloads from there: each
    pressure has its own. A model that solves the map anew for each load gets at most `MAX_SOLVED`
    pressures, and two more halfway to the ends; halfway between them it is measured.

    Of several scans it is that of their joint, in which each bears p and all move by one delta:
    k_n, k_t, tau and w are the means over the scans by their areas, and the scatter is their
    standard deviation. The closure d is the integral of dp / k_n.

    Parameters
    ----------
    parts : sequence of Part
        What each scan of the joint says of it, under its share of the load.
    friction_coefficient : float
        mu.
    holds : callable, optional
        Whether all that touches is a cap of the curves, where each scan bears its load times a
        factor. Pressures above that of the scan end where it is not.

    Raises
    ------
    ContactError
        If no scanned area is known, or a curve cannot carry the lower pressures. Those of a map
        whose slip cannot be followed are left out.
    SettingsError
        If an argument is of the wrong type, or there is no part.

    Notes
    -----
    The errors of what lies between the points of the tables are the largest at `pressure_Pa`, from
    a tenth of mu p on; where each pressure has its own curve, at the quarters between, too. Where
    each has a solution of its own, the face is solved halfway between them as well,
    and at the quarters where it is off the most. The errors there are taken for a sample: its
    largest, or its mean and 1.96 standard deviations where that is more, and a fifth of it for
    other pressures and forces. Errors are the largest at the ends, where the least touches and the
    most joins: there solutions lie closer. Beds of a map are compared at equal loads or at equal
    shares of their pressures, in each interval by what tells more of the face there: the first
    where it is elastic, the second where most of it yields.

    Slip: Eqs. 3-16 of Peyret, Chevallier and Dion, Int. J. Appl. Mech. 8 (2016) 1650097, see
    `contact.slip`.
    """
    check_kind("parts", parts, Sequence, "a list of what each scan says, as analysis.parts")
    for i, part in enumerate(parts):
        check_kind(f"parts[{i}]", part, Part, "one of analysis.parts")
    if not parts:
        raise SettingsError("parts: got none; expected one or more, as analysis.parts")
    check_kind("friction_coefficient", friction_coefficient, Real, "a number")
    if holds is not None:
        check_call("holds", holds)
    contacts, area_m2 = [part.contact for part in parts], [_area_m2(part.joint) for part in parts]
    patches, ends = _patches(parts, friction_coefficient, holds)
    patches, between = _refined(parts, patches)
    slips = [_together(parts, patch) for patch in patches]
    rows = _rows(slips, SHARES if len(parts) == 1 else SHARES_OF_SCANS)
    delta, range_Pa = rows["displacement_m"], rows["pressure_Pa"][[0, -1]]
    scan_Pa = parts[0].joint.scan_load_N / area_m2[0]
    kappa = min(slips, key=lambda slip: abs(math.log(slip.preload_N / scan_Pa))).kappa
    of_joint = dict(zip(OF_JOINT, (friction_coefficient, kappa, range_Pa), strict=True))
    at_shares, between_solved = [False] * (len(patches) - 1), np.zeros(3)
    if halfway := _is_solved(parts):
        at_shares, between_solved = _between_solved(parts, patches, of_joint)
    of_scans, tested = _of_scans(parts, patches, at_shares), [*patches, *between]
    if not (len(parts) == 1 and _has_one_bed(of_scans[0])):
        share = [part.share for part in parts]
        rows["closure_m"] = np.array([closure_together_m(patch, share) for patch in patches])
    resolved = np.array([resolved_share(parts, patch) for patch in tested])
    tested_slips = [*slips, *(_together(parts, patch) for patch in between)]
    shares, tables = delta[0] / delta[0, -1], tables_of(_tables(of_joint, of_scans))
    of_tables = errors_of_tables(tables, tested_slips, shares, resolved)
    greatest = np.maximum(of_tables.max(axis=1), between_solved)
    shear_error, loss_error, stiffness_error = greatest.tolist()
    errors = [contact.estimated_error for contact in contacts]
    return Law(
        **rows,
        total_slip_displacement_m=delta[:, -1],
        scatter=_scatter(parts, patches, delta),
        of_scans=of_scans,
        elements=tuple(jenkins(slip, JENKINS_TOLERANCE) for slip in slips),
        friction_coefficient=friction_coefficient,
        kappa=kappa,
        scan_pressure_Pa=scan_Pa,
        scans=len(parts),
        area_m2=sum(area_m2),
        finds_levels=any(part.contact.at_level is not None for part in parts),
        no_level_Pa=tuple(float(p[0].preload_N) for p in patches if _without_level(parts, p)),
        ends=ends,
        holds_bulk=any(contact.bulk for contact in contacts),
        hardness_Pa=contacts[0].hardness_Pa,
        model=slips[0].curve.model,
        model_error=None if None in errors else max(error for error in errors if error is not None),
        halfway=halfway,
        shear_error=shear_error,
        loss_error=loss_error,
        stiffness_error=stiffness_error,
        resolved_share=resolved[: len(patches)],
    )


def _area_m2(joint: Joint) -> float:
    if joint.scan_area_m2 is None:
        raise ContactError("it is a law per area, which needs a scanned area")
    return joint.scan_area_m2


def _is_solved(parts: Sequence[Part]) -> bool:
    """Tell whether a model solves the map anew for each pressure."""
    return any(part.contact.rung.solved_loads_N is not None for part in parts)


def _tables(of_joint: dict[str, Any], of_scans: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return what `tables_of` takes of all scans."""
    return of_joint | (of_scans[0] if len(of_scans) == 1 else {"of_scans": list(of_scans)})


def _of_scans(
    parts: Sequence[Part], patches: Sequence[Sequence[SlipCurve]], at_shares: Sequence[bool] = ()
) -> tuple[dict[str, Any], ...]:
    """Return what `tables_of` takes of each scan under growing pressures.

    Beds of a map, two for each interval, at equal shares of their pressures or at equal loads.
    """
    found = []
    for part, slips in zip(parts, zip(*patches, strict=True), strict=True):
        rows, is_solved = _rows(slips, SHARES), part.contact.rung.solved_loads_N is not None
        own_curves = _has_own_curves(part)
        least_Pa = LEAST_LOAD * part.joint.scan_load_N / _area_m2(part.joint)
        if own_curves and is_solved:
            tables = beds_between(slips, at_shares)
        elif own_curves and not serves_all(slips[-1], rows):
            tables = beds_at_loads(slips, least_Pa)
        elif is_solved:
            tables = bed_of_solutions(rows)
        else:
            tables = bed_of_curve(slips[-1], least_Pa)
        share = {} if len(parts) == 1 else {"share": part.share}
        found.append(share | kappa_of(slips) | tables)
    return tuple(found)


def _has_one_bed(scan: dict[str, Any]) -> bool:
    return BED[0] in scan and np.ndim(scan[BED[0]]) == 1


def _has_own_curves(part: Part) -> bool:
    """Tell whether each pressure may have a curve of its own: it yields, or finds a level anew."""
    return part.contact.hardness_Pa is not None or part.contact.at_level is not None


def _rows(slips: Sequence[SlipCurve], shares: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of slip curves per area, at shares of the displacement at total slip."""
    D = np.array([float(slip.total_slip_displacement_m) for slip in slips])
    delta = D[:, None] * shares
    return {
        "pressure_Pa": np.array([float(slip.preload_N) for slip in slips]),
        "closure_m": np.array([float(slip.approach_m - slip.curve.touch_m) for slip in slips]),
        "displacement_m": delta,
        **sheared(slips, delta),
    }


def _scatter(
    parts: Sequence[Part], patches: Sequence[Sequence[SlipCurve]], delta: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the standard deviation between scans, weighed by area; {} for one of them.

    sqrt(sum s (x - mean)^2 / (1 - sum s^2)) with the shares s: over n - 1 where they are equal.
    """
    if len(parts) == 1:
        return {}
    share = np.array([part.share for part in parts])
    scans = [sheared(slips, delta) for slips in zip(*patches, strict=True)]
    found = {}
    for name, column in SCATTERS.items():
        values = np.array([scan[name] for scan in scans])
        off = values - np.tensordot(share, values, 1)
        found[column] = np.sqrt(np.tensordot(share, off**2, 1) / (1.0 - share @ share))
    return found


def _together(parts: Sequence[Part], patch: Sequence[SlipCurve]) -> SlipCurve:
    """Return the slip curve of patches that bear one pressure and move together."""
    if len(patch) == 1:
        return patch[0]
    share, p = [part.share for part in parts], patch[0].preload_N
    curves, each = [slip.curve for slip in patch], [slip.kappa for slip in patch]
    curve, kappa = joint_of_scans(curves, p, share, each)
    return slip_curve(curve, p, patch[0].friction_coefficient, kappa)


def _patches(
    parts: Sequence[Part], friction_coefficient: float, holds: Callable[[float], bool] | None
) -> tuple[list[list[SlipCurve]], str]:
    """Return the slip curve per area of each scan under growing pressures, and why they end.

    They begin where the slip of a map can be followed: under less, too few of its pixels may touch.
    """
    solves, ratio, below, above = _is_solved(parts), RATIO, BELOW, ABOVE
    if parts[0].contact.hardness_Pa is not None:
        ratio, below, above = RATIO_OF_OWN, BELOW_OF_OWN, ABOVE_OF_OWN
    if solves:
        ratio, below, above = RATIO_SOLVED, BELOW_SOLVED, ABOVE_SOLVED
    patches: list[list[SlipCurve]] = []
    begins = ""  # why they do not begin lower
    for i in range(-below, above + 1):
        try:
            patch = [_patch(part, ratio**i, friction_coefficient) for part in parts]
            for slip in patch if solves else []:  # solved when first asked for, and not always
                slip.energy_J(slip.total_slip_displacement_m)
        except ContactError as error:
            if i == 0 or (i < 0 and not solves):
                raise
            if i > 0:
                return patches, f"{begins}the model carries no more: {error}"
            begins, patches = f"the slip under less cannot be followed: {error}; ", []
            continue
        if i > 0 and holds is not None and not holds(ratio**i):
            return patches, (
                "under more than this the face may touch where no cap of the curve stands; analyse "
                "the scan at a higher pressure for more"
            )
        patches.append(patch)
    few = f"{MAX_SOLVED + 2} pressures, as each is solved on the whole map, " if solves else ""
    return patches, f"{begins}{few}{ratio**above:.2g} times the pressure of the analysis"


def _refined(
    parts: Sequence[Part], patches: list[list[SlipCurve]]
) -> tuple[list[list[SlipCurve]], list[list[SlipCurve]]]:
    """Return patches under more pressures where the law between two needs them.

    Where contacts touch or yield or the face turns between two of them, and at both ends where
    each is solved. And patches at the quarters between all, where each pressure has a bed of its
    own, to judge the law by.
    """
    if _is_solved(parts):
        return _with_ends_halved(parts, patches), []
    if not any(map(_has_own_curves, parts)):
        return patches, []
    mu, kappa = patches[0][0].friction_coefficient, _together(parts, patches[0]).kappa
    to_factor = _area_m2(parts[0].joint) / parts[0].joint.scan_load_N
    halfway: dict[float, list[SlipCurve]] = {}
    for turn in range(MOST_TURNS + 1):
        of_scans = _of_scans(parts, patches)
        if all(map(_has_one_bed, of_scans)):
            return patches, []
        p = np.array([float(patch[0].preload_N) for patch in patches])
        middle = np.sqrt(p[1:] * p[:-1]).tolist()
        for one in (one for one in middle if one not in halfway):
            halfway[one] = [_patch(part, one * to_factor, mu) for part in parts]
        tested = [halfway[one] for one in middle]
        tables = _tables(dict(zip(OF_JOINT, (mu, kappa, p[[0, -1]]), strict=True)), of_scans)
        slips = [_together(parts, patch) for patch in tested]
        errors = np.max(errors_of_tables(tables_of(tables), slips, SHARES)[:2], axis=0)
        poor = [patch for patch, error in zip(tested, errors, strict=True) if error > BETWEEN]
        if not poor or turn == MOST_TURNS:
            break
        patches = sorted([*patches, *poor], key=lambda patch: float(patch[0].preload_N))
    quarters = np.append(p[1:] ** 0.25 * p[:-1] ** 0.75, p[1:] ** 0.75 * p[:-1] ** 0.25).tolist()
    more = [[_patch(part, one * to_factor, mu) for part in parts] for one in quarters]
    return patches, [*tested, *more]


def _with_ends_halved(
    parts: Sequence[Part], patches: list[list[SlipCurve]]
) -> list[list[SlipCurve]]:
    """Return patches under the pressures halfway to the least and the greatest one, too.

    There the least touches, and the most joins.
    """
    p, mu = [float(patch[0].preload_N) for patch in patches], patches[0][0].friction_coefficient
    to_factor = _area_m2(parts[0].joint) / parts[0].joint.scan_load_N
    more = list(patches)
    for one in {math.sqrt(low * high) for low, high in (p[:2], p[-2:])} if len(p) > 1 else ():
        with suppress(ContactError):  # then the others stand for it, as they would have
            patch = [_patch(part, one * to_factor, mu) for part in parts]
            for slip in patch:
                slip.energy_J(slip.total_slip_displacement_m)
            more.append(patch)
    return sorted(more, key=lambda patch: float(patch[0].preload_N))


def _patch(part: Part, factor: float, friction_coefficient: float) -> SlipCurve:
    """Return the slip curve per area of a scan under its load times a factor."""
    contact, area_m2 = part.contact, _area_m2(part.joint)
    pressure_Pa = part.joint.scan_load_N / area_m2 * factor
    load_N = pressure_Pa * area_m2
    patch = contact if factor == 1.0 else contact.of_patch(load_N)
    per_area = curve_of_joint(patch.curve, np.array([load_N]), np.array([1.0 / area_m2]))
    return slip_curve(per_area, pressure_Pa, friction_coefficient, patch.composite.kappa)


def _without_level(parts: Sequence[Part], patch: Sequence[SlipCurve]) -> bool:
    """Tell whether one of the scans finds no level under the pressure of a patch."""
    pairs = zip(parts, patch, strict=True)
    return any(one.contact.lacks_level(slip.preload_N * _area_m2(one.joint)) for one, slip in pairs)


def _followed(
    parts: Sequence[Part], low: Sequence[SlipCurve], high: Sequence[SlipCurve], share: float
) -> list[SlipCurve] | None:
    """Return patches at a share of the way between two pressures; None if not to be followed."""
    p = float(low[0].preload_N) ** (1.0 - share) * float(high[0].preload_N) ** share
    to_factor = _area_m2(parts[0].joint) / parts[0].joint.scan_load_N
    with suppress(ContactError):
        patch = [_patch(part, p * to_factor, low[0].friction_coefficient) for part in parts]
        for slip in patch:
            slip.energy_J(slip.total_slip_displacement_m)
        return patch
    return None


def _between_solved(
    parts: Sequence[Part], patches: list[list[SlipCurve]], of_joint: dict[str, Any]
) -> tuple[list[bool], np.ndarray]:
    """Return where beds are alike at shares of their pressures, and errors between solutions.

    Of each interval; and those of shear, loss and stiffness before slip, infinite where nothing is
    known halfway. Where they are the largest halfway, the quarters are asked, too.
    """
    ways = (False, True) if any(map(_has_own_curves, parts)) else (False,)
    n = len(patches) - 1
    tables = [tables_of(_tables(of_joint, _of_scans(parts, patches, [way] * n))) for way in ways]

    def errors(i: int, *shares: float) -> np.ndarray:
        """Errors of one interval, of each way the largest, shape (ways, 3); 0 if not known."""
        found = np.zeros((len(ways), 3))
        for share in shares:
            if (patch := _followed(parts, patches[i], patches[i + 1], share)) is not None:
                slip, resolved = _together(parts, patch), resolved_share(parts, patch)
                each = [errors_at_forces(one, slip, FORCES_BETWEEN, resolved) for one in tables]
                found = np.maximum(found, each)
        return found

    found = np.array([errors(i, 0.5) for i in range(n)]).reshape(n, len(ways), 3)
    of_loss = found[:, :, 1].min(axis=1)
    for i in np.argsort(-of_loss)[:MOST_UNLIKE].tolist():
        if of_loss[i] > BETWEEN:
            found[i] = np.maximum(found[i], errors(i, 0.25, 0.75))
    best = found[:, :, 1].argmin(axis=1)
    known = found[np.arange(n), best][found.any(axis=(1, 2))]
    taken = [ways[way] for way in best.tolist()]
    if not len(known):
        return taken, np.full(3, np.inf)
    likely = known.mean(axis=0) + NORMAL_95 * known.std(axis=0, ddof=min(len(known) - 1, 1))
    return taken, ELSEWHERE * np.maximum(known.max(axis=0), likely)
