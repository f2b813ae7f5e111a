"""The result of one analysis, and the dictionary of `summary.json` that is made of it.

In the dictionary every key is present, absent values are null, and units are in the names.
"""

import math
import platform
from dataclasses import asdict, dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

import capslip
from capslip.caps.families import Families, Family
from capslip.caps.hills import Hills
from capslip.caps.iso25178 import Iso25178
from capslip.caps.table import CapTable
from capslip.contact.joint import Joint
from capslip.contact.levelling import Level
from capslip.contact.press import ContactState
from capslip.contact.slip import SlipCurve
from capslip.problems import Problem
from capslip.provenance import code_sha256, libraries
from capslip.sensitivity import Sensitivity
from capslip.settings import Settings
from capslip.structure.answer import Answer, asked
from capslip.structure.band import Band
from capslip.structure.beam import BeamMode
from capslip.structure.response import MOST_LOSS_FACTOR, Damping, lightly_damped
from capslip.structure.stiffness import structure_name
from capslip.surface.conditioning import Conditioned
from capslip.surface.heightmap import HeightMap, Origin
from capslip.surface.spectrum import carried_waves_m
from capslip.verdict import assumptions, verdict

if TYPE_CHECKING:
    from capslip.output.arrays import Tables
    from capslip.output.plots import Plots

SCHEMA = "capslip/summary/1"
ROUNDING = 1e-9  # of the face; a resultant that is less off the load point is on it


@dataclass(frozen=True, eq=False)
class JointResult:
    """What is known of a joint, from a scan or not; the stages that could not run are None."""

    settings: Settings
    joint: Joint
    families: Families | None  # None: those of each scan are its own
    contact: ContactState | None
    slip: SlipCurve | None
    beam: BeamMode | None  # None where the settings give the two stiffnesses
    damping: Damping | None
    answer: Answer | None  # None: beyond gross slip, too
    band: Band | None  # None: nothing is known to be uncertain, too
    problems: tuple[Problem, ...]
    timings_s: dict[str, float]
    started: str

    @property
    def name(self) -> str:
        """What the result is called."""
        return "families"

    @property
    def status(self) -> str:
        """Return "failed" with an error among the problems, "check" with a warning, or "ok"."""
        severities = {p.severity for p in self.problems}
        if "error" in severities:
            return "failed"
        return "check" if "warning" in severities else "ok"

    @property
    def verdict(self) -> str:
        """Return one sentence on what the result is usable for."""
        return verdict(self.settings, self.problems, self.estimated_error)

    @property
    def estimated_error(self) -> float | None:
        """Return that of the contact model, of energy at given force and of stiffness."""
        return self.contact.estimated_error if self.contact else None

    def summary(
        self, command: str | None = None, timings_s: dict[str, float] | None = None
    ) -> dict[str, Any]:
        """Return the dictionary of `summary.json`: plain numbers, strings, lists, dictionaries.

        Parameters
        ----------
        command : str, optional
            The command line, for the record.
        timings_s : dict, optional
            Seconds of what was done outside the analysis (reading, drawing, ...).
        """
        tables = {
            "schema": SCHEMA,
            "name": self.name,
            "status": self.status,
            "verdict": self.verdict,
            "answer": _answer(self),
            "assumed": [
                {"name": one.name, "setting": one.setting, "value": one.value, "moves": one.moves}
                for one in assumptions(self.settings)
            ],
            "surface": None,
            "hills": None,
            "families": _families(self.families),
            "contact": _contact(self),
            "slip": _slip(self),
            "damping": _damping(self),
            "accuracy": {
                "requested": self.settings.contact.tolerance,
                "estimated": self.estimated_error,
                "model_reason": self.contact.model_reason if self.contact else None,
            },
            "sensitivity": None,
            "scans": None,
            **self._of_the_scan(),
            "problems": [_problem(problem) for problem in self.problems],
            "timings_s": {**self.timings_s, **(timings_s or {})},
            "provenance": {
                "version": capslip.__version__,
                "code_sha256": code_sha256(),
                "libraries": libraries(),
                "python": platform.python_version(),
                "platform": platform.platform(),
                "command": command,
                "settings_sha256": self.settings.sha256(),
                "started": self.started,
            },
        }
        plain: dict[str, Any] = _plain(tables)
        return plain

    def _of_the_scan(self) -> dict[str, Any]:
        """Return the tables of what a scan shows."""
        return {}


@dataclass(frozen=True, eq=False, repr=False)
class Analysis(JointResult):
    """All that one analysis of a scan found; the stages that could not run are None.

    Examples
    --------
    >>> from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
    >>> scene = Scene((100, 150), (4e-4, 4e-4), families=(CapFamily("G", 6, 24.0),))
    >>> analysis = capslip.analyze(synthetic_surface(scene)[0])
    >>> len(analysis.tables.caps), f"{analysis.slip.total_slip_force_N:.1f} N"
    (6, '92.0 N')
    """

    families: Families
    surface: HeightMap
    conditioned: Conditioned  # with the surface at the level at which it is pressed
    level: Level | None  # None: as levelled
    hills: Hills
    caps: CapTable
    sensitivity: Sensitivity | None  # None where it was not asked for
    iso25178: Iso25178  # of the conditioned map, computed when they are asked for
    mate: Origin | None = None  # of the other face, where there is one

    @property
    def name(self) -> str:
        """Name of the scan."""
        return self.surface.origin.name

    @property
    def plot(self) -> "Plots":
        """The figures, each a method that returns Matplotlib axes: `analysis.plot.loop()`."""
        return capslip.Plots(self)

    @property
    def tables(self) -> "Tables":
        """The numbers as NumPy structured arrays: `analysis.tables.caps["radius_m"]`."""
        return capslip.Tables(self)

    def __repr__(self) -> str:
        contact, peak = _contact(self), _damping(self)["peak_loss_factor"]
        of = structure_name(self.settings)
        loss = "no loss factor" if peak is None else f"loss factor {peak:.3g} of the {of}"
        return (
            f"<Analysis of {self.name}: {self.status}, {self.caps.usable.sum()} caps, "
            f"{contact['model'] or 'no contact'} at {contact['preload_N']:g} N, {loss}, "
            f"{len(self.problems)} problems>"
        )

    def _repr_html_(self) -> str:
        """Return a small table, for notebooks."""
        slip, damping = _plain(_slip(self)), _plain(_damping(self))
        rows = {
            "verdict": self.verdict,
            "caps": int(self.caps.usable.sum()),
            "G-caps, P-caps": f"{self.families.m}, {self.families.n}",
            "contact model": self.contact.model if self.contact else None,
            "preload [N]": float(self.joint.preload_N),
            "tangential stiffness [N/m]": slip["tangential_stiffness_N_per_m"],
            f"greatest loss factor, {damping['structure']}": damping["peak_loss_factor"],
            "gross slip amplitude [m]": damping["gross_slip_amplitude_m"],
            **{problem.code: problem.text for problem in self.problems},
        }
        body = "".join(
            f"<tr><th>{escape(name)}</th><td>{_cell(value)}</td></tr>"
            for name, value in rows.items()
        )
        caption = f"{escape(self.name)}: {self.status}"
        return f"<table><caption>{caption}</caption>{body}</table>"

    def _of_the_scan(self) -> dict[str, Any]:
        return {
            "surface": _surface(self),
            "hills": _hills(self),
            "sensitivity": self.sensitivity.to_dict() if self.sensitivity else None,
        }


@dataclass(frozen=True, eq=False, repr=False)
class JointOfScans(JointResult):
    """A joint of which several scans are known, each of which was analysed as if it were alone."""

    scans: tuple[Analysis, ...]

    @property
    def name(self) -> str:
        """What the result is called."""
        return "scans"

    @property
    def known(self) -> tuple[Analysis, ...]:
        """The scans that have a slip curve, so of which the joint is made."""
        return tuple(scan for scan in self.scans if scan.slip is not None)

    @property
    def verdict(self) -> str:
        """Return one sentence on what the result is usable for, and on how many scans it rests."""
        count = (len(self.known), len(self.scans))
        return verdict(self.settings, self.problems, self.estimated_error, count)

    @property
    def estimated_error(self) -> float | None:
        """Return the greatest of the scans; None where that of one is not known."""
        errors = [scan.estimated_error for scan in self.known]
        known = [error for error in errors if error is not None]
        return max(known) if known and len(known) == len(errors) else None

    def _of_the_scan(self) -> dict[str, Any]:
        area_m2 = sum(scan.joint.scan_area_m2 or 0.0 for scan in self.known)
        return {"scans": [_scan(scan, area_m2) for scan in self.scans]}


def _scan(analysis: Analysis, area_m2: float) -> dict[str, Any]:
    """Return the numbers of one of several scans: of the joint if all of its face were as here."""
    contact, joint, origin = analysis.contact, analysis.joint, analysis.surface.origin
    share = None if analysis.slip is None else (joint.scan_area_m2 or 0.0) / area_m2
    return {
        "name": analysis.name,
        "path": origin.path,
        "sha256": origin.sha256,
        "status": analysis.status,
        "scan_area_m2": joint.scan_area_m2,
        "share": share,
        "scan_load_N": joint.scan_load_N,
        "sq_m": analysis.conditioned.sq_m,
        "caps": int(analysis.caps.usable.sum()),
        "model": contact.model if contact else None,
        "contacts": contact.contacts if contact else None,
        "approach_m": contact.approach_m if contact else None,
        "max_pressure_Pa": contact.max_pressure_Pa if contact else None,
        "estimated_error": analysis.estimated_error,
        "answer": {
            name: getattr(analysis.answer, name, None) for name in Answer.__dataclass_fields__
        },
        "problems": [_problem(problem) for problem in analysis.problems],
    }


def _cell(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else escape(str(value))


def _answer(analysis: JointResult) -> dict[str, Any]:
    """Return the question and its answer, of one joint and of the structure."""
    question = analysis.settings.answer
    quantity, value = asked(question, analysis.slip)
    by_default = all(getattr(question, name) is None for name in question.__struct_fields__)
    names, band = Answer.__dataclass_fields__, analysis.band
    return {
        "asked": {"quantity": quantity, "value": value, "by_default": by_default},
        "structure": structure_name(analysis.settings),
        **{name: getattr(analysis.answer, name, None) for name in names},
        "interval": {name: band.interval.get(name) for name in names} if band else None,
        "contributions": band.contributions if band else None,
        "not_in_interval": band.left_out if band else None,
    }


def _surface(analysis: Analysis) -> dict[str, Any]:
    surface, conditioned, mate = analysis.surface, analysis.conditioned, analysis.mate
    return {
        "path": surface.origin.path,
        "sha256": surface.origin.sha256,
        "mate": None if mate is None else {"path": mate.path, "sha256": mate.sha256},
        "shape": list(surface.shape),
        "pixel_size_m": list(surface.pixel_size_m),
        "non_measured_fraction": 1.0 - surface.measured.mean(),
        "sq_m": conditioned.sq_m,
        "sz_m": conditioned.sz_m,
        "form": analysis.settings.conditioning.form,
        "steps": list(conditioned.steps),
        "format": surface.origin.file_format,
        "dataset": surface.origin.dataset,
        "height_unit": surface.origin.height_unit,
        "lateral_unit": surface.origin.lateral_unit,
        "iso25178": {
            **analysis.iso25178.to_dict(),
            "carried_waves_m": carried_waves_m(
                conditioned.surface,
                analysis.hills.noise_m,
                analysis.settings.conditioning.s_filter_nesting_index_m,
                analysis.settings.conditioning.l_filter_nesting_index_m,
            ),
            "contact_diameter_m": analysis.caps.contact_diameter_m,
        },
    }


def _hills(analysis: Analysis) -> dict[str, Any]:
    hills, caps, level = analysis.hills, analysis.caps, analysis.level
    ratio = analysis.settings.hills.material_ratio
    usable = int(caps.usable.sum())
    rejected = dict(hills.rejected)
    if usable < len(caps):
        rejected["no_sphere"] = len(caps) - usable
    return {
        "material_ratio": ratio if level is None else level.material_ratio,
        "cut_certified": None if level is None else level.missed_area_m2 == 0.0,
        "cut_height_m": hills.cut_height_m,
        "kept_fraction": hills.kept_fraction,
        "regions": hills.n_regions,
        "largest_region_share": hills.largest_region_share,
        "hills": hills.n_hills,
        "caps": usable,
        "rejected": rejected,
        "noise_m": hills.noise_m,
        "pruning_height_m": hills.pruning_height_m,
        "hills_half_pruning": hills.n_hills_half_pruning,
        "hills_double_pruning": hills.n_hills_double_pruning,
        "largest_hill_share": hills.largest_hill_share,
    }


def _families(families: Families | None) -> dict[str, Any]:
    if families is None:
        names = ("count", "m", "n", "h_m", "h_se_m", "count_se", "separation", "log_odds", "clear")
        return {**dict.fromkeys((*names, "G", "P")), "levels": []}
    return {
        "count": families.count,
        "m": families.m,
        "n": families.n,
        "h_m": families.h_m,
        "h_se_m": families.h_se_m,
        "count_se": families.count_se,
        "separation": families.separation,
        "log_odds": families.log_odds,
        "clear": families.clear,
        "levels": [_family(family) for family in families.levels],
        "G": _family(families.G),
        "P": _family(families.P),
    }


def _contact(analysis: JointResult) -> dict[str, Any]:
    """Return the contact: loads and stiffness of the joint, the rest of the scan in it."""
    contact, joint, slip = analysis.contact, analysis.joint, analysis.slip
    area_m2 = contact.contact_area_m2 if contact and joint.is_even else None
    yielded_m2 = contact.yielded_area_m2 if contact and joint.is_even else None
    return {
        "model": contact.model if contact else None,
        "preload_N": joint.preload_N,
        "nominal_pressure_Pa": joint.nominal_pressure_Pa,
        "coverage": joint.coverage,
        "joint_area_m2": joint.area_m2,
        "scan_area_m2": joint.scan_area_m2,
        "scan_load_N": joint.scan_load_N,
        "pressure_classes": len(joint.load_N),
        "approach_m": contact.approach_m if contact else None,
        "approach_without_bulk_m": contact.approach_without_bulk_m if contact else None,
        "contacts": contact.contacts if contact else None,
        "stiffness_N_per_m": slip.curve.stiffness_N_per_m(slip.approach_m) if slip else None,
        "contact_area_m2": None if area_m2 is None else area_m2 * float(joint.weight[0]),
        "max_pressure_Pa": contact.max_pressure_Pa if contact else None,
        "hardness_Pa": contact.hardness_Pa if contact else None,
        "yielded_area_m2": None if yielded_m2 is None else yielded_m2 * float(joint.weight[0]),
        "bulk": contact.bulk if contact else None,
        **_alignment(analysis),
    }


def _alignment(analysis: JointResult) -> dict[str, Any]:
    """Return how the face lies under its preload; slopes and places along x and y."""
    contact = analysis.contact
    if contact is None or not isinstance(analysis, Analysis):
        names = ("alignment", "tilt_rad", "tilt_across_face_m", "load_point_m", "eccentricity_m")
        return dict.fromkeys((*names, "resultant_off_load_point_m"))
    level = analysis.level
    tilt_rad = np.add(contact.tilt_rad, (0.0, 0.0) if level is None else level.slope)
    balanced = level is not None or any(contact.tilt_rad)
    ly_m, lx_m = analysis.surface.side_m
    off_m = None if contact.eccentricity_m is None else math.hypot(*contact.eccentricity_m)
    if off_m is not None and off_m < ROUNDING * math.hypot(ly_m, lx_m):
        off_m = 0.0
    return {
        "alignment": "balanced" if balanced else "as_levelled",
        "tilt_rad": tilt_rad,
        "tilt_across_face_m": float(np.abs(tilt_rad) @ (lx_m, ly_m)),
        "load_point_m": contact.load_point_m,
        "eccentricity_m": contact.eccentricity_m,
        "resultant_off_load_point_m": off_m,
    }


def _slip(analysis: JointResult) -> dict[str, Any]:
    slip = analysis.slip
    return {
        "friction_coefficient": analysis.settings.material.friction_coefficient,
        "total_slip_force_N": slip.total_slip_force_N if slip else None,
        "total_slip_displacement_m": slip.total_slip_displacement_m if slip else None,
        "limit_G_m": _limit(analysis, "G"),
        "limit_P_m": _limit(analysis, "P"),
        "tangential_stiffness_N_per_m": slip.tangential_stiffness_N_per_m if slip else None,
    }


def _damping(analysis: JointResult) -> dict[str, Any]:
    damping = analysis.damping
    peak = lightly_damped(damping.peak_loss_factor) if damping else None
    first = damping.first_peak_loss_factor if damping else None
    first = None if first is None else lightly_damped(first)
    return {
        "structure": structure_name(analysis.settings),
        "amplitude_m": damping.amplitude_m if damping else [],
        "loss_factor": _where_defined(damping, damping.loss_factor) if damping else [],
        "damping_ratio": _where_defined(damping, damping.damping_ratio) if damping else [],
        "frequency_ratio": damping.frequency_ratio if damping else [],
        "peak_loss_factor": peak,
        "amplitude_at_peak_m": damping.amplitude_at_peak_m if damping else None,
        "first_peak_loss_factor": first,
        "amplitude_at_first_peak_m": damping.amplitude_at_first_peak_m if damping else None,
        "gross_slip_amplitude_m": damping.gross_slip_amplitude_m if damping else None,
        "modal_stiffness_N_per_m": damping.modal_stiffness_N_per_m if damping else None,
        "joint_stiffness_N_per_m": damping.joint_stiffness_N_per_m if damping else None,
        "joints": analysis.settings.structure.joints,
    }


def _where_defined(damping: Damping, values: np.ndarray) -> np.ndarray:
    """Return values of a mode that is lightly damped; NaN elsewhere."""
    return np.where(damping.loss_factor <= MOST_LOSS_FACTOR, values, np.nan)


def _problem(problem: Problem) -> dict[str, Any]:
    return {
        "code": problem.code,
        "severity": problem.severity,
        "message": problem.text,
        "effect": None if problem.effect is None else asdict(problem.effect),
        "remedy": problem.kind.remedy,
    }


def _limit(analysis: JointResult, family: str) -> float | None:
    """Return the displacement at which the last cap of a family slips as a whole."""
    contact, slip = analysis.contact, analysis.slip
    if contact is None or slip is None:
        return None
    # The rows of a joint are those of its scan, patch by patch
    at = np.resize(contact.row_family, slip.limits_m.shape) == family
    if not at.any():
        return None
    limits_m = slip.limits_m[at & np.isfinite(slip.limits_m)]
    return float(limits_m.max()) if limits_m.size else None


def _family(family: Family | None) -> dict[str, Any] | None:
    if family is None:
        return None
    names = ("count", "radius_m", "radius_se_m", "mean_radius_m", "diameter_m", "height_m")
    return {name: getattr(family, name) for name in (*names, "peak_height_m", "peak_height_se_m")}


def _plain(value: Any) -> Any:
    """Make numpy values plain, and what is not a finite number null."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
