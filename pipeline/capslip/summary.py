"""The dictionary of `summary.json`: the numbers of a result as JSON holds them.

Every key is present, absent values are null, and units are in the names.
"""

import math
import platform
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

import capslip
from capslip.caps.families import Families, Family
from capslip.contact.material import hardness_Pa
from capslip.problems import Problem
from capslip.provenance import code_sha256, libraries
from capslip.structure.answer import Answer, asked
from capslip.structure.response import MOST_LOSS_FACTOR, Damping, lightly_damped
from capslip.structure.stiffness import structure_name
from capslip.surface.noise import known_noise_m
from capslip.surface.spectrum import carried_waves_m
from capslip.verdict import assumptions

if TYPE_CHECKING:
    from capslip.result import Analysis, JointResult

SCHEMA = "capslip/summary/1"
ALIGNMENT = (
    "alignment",
    "tilt_rad",
    "tilt_across_face_m",
    "load_point_m",
    "eccentricity_m",
    "resultant_off_load_point_m",
)
# Of the face: a resultant that is less off the load point is on it. A contact that yielded keeps
# its load and not its moment, which leaves nanometres on a face of millimetres.
ON_POINT = 1e-6


def summary_of(
    result: "JointResult",
    command: str | None = None,
    timings_s: dict[str, float] | None = None,
    texture: bool = True,
) -> dict[str, Any]:
    """Return the dictionary of `summary.json`: see `JointResult.summary`.

    Without the parameters of its texture a scan lacks its table `surface`; they take as long as
    all stages together, and the numbers on a terminal hold none of them.
    """
    tables = {
        "schema": SCHEMA,
        "name": result.name,
        "status": result.status,
        "verdict": result.verdict,
        "answer": _answer(result),
        "assumed": [
            {"name": one.name, "setting": one.setting, "value": one.value, "moves": one.moves}
            for one in assumptions(result.settings, result.noise_known)
        ],
        "surface": None,
        "hills": None,
        "families": _families(result.families),
        "contact": contact_table(result),
        "slip": slip_table(result),
        "damping": damping_table(result),
        "accuracy": {
            "requested": result.settings.contact.tolerance,
            "estimated": result.estimated_error,
            "model_reason": result.contact.model_reason if result.contact else None,
        },
        "sensitivity": None,
        "scans": None,
        **result.of_the_scan(texture),
        "problems": [_problem(problem) for problem in result.problems],
        "timings_s": {**result.timings_s, **(timings_s or {})},
        "provenance": {
            "version": capslip.__version__,
            "code_sha256": code_sha256(),
            "libraries": libraries(),
            "python": platform.python_version(),
            "platform": platform.platform(),
            "command": command,
            "settings_sha256": result.settings.sha256(),
            "started": result.started,
        },
    }
    found: dict[str, Any] = plain(tables)
    return found


def scan_table(analysis: "Analysis", area_m2: float) -> dict[str, Any]:
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


def _answer(analysis: "JointResult") -> dict[str, Any]:
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


def surface_table(analysis: "Analysis") -> dict[str, Any]:
    """Return the scan: its file, size, roughness and parameters."""
    surface, conditioned, mate = analysis.surface, analysis.conditioned, analysis.mate
    return {
        "path": surface.origin.path,
        "sha256": surface.origin.sha256,
        "mate": None if mate is None else {"path": mate.path, "sha256": mate.sha256},
        "shape": list(surface.shape),
        "pixel_size_m": list(surface.pixel_size_m),
        "non_measured_fraction": 1.0 - surface.n_measured / surface.size,
        "sq_m": conditioned.sq_m,
        "sz_m": conditioned.sz_m,
        "measurement_noise_m": known_noise_m(conditioned.surface, analysis.settings),
        "form": analysis.settings.conditioning.form,
        "steps": list(conditioned.steps),
        "format": surface.origin.file_format,
        "dataset": surface.origin.dataset,
        "height_unit": surface.origin.height_unit,
        "lateral_unit": surface.origin.lateral_unit,
        "iso25178": {
            **analysis.iso25178.to_dict(with_hills=analysis.settings.run.figures),
            "carried_waves_m": carried_waves_m(
                conditioned.surface,
                analysis.hills.noise_m,
                analysis.settings.conditioning.s_filter_nesting_index_m,
                analysis.settings.conditioning.l_filter_nesting_index_m,
            ),
            "contact_diameter_m": analysis.caps.contact_diameter_m,
        },
    }


def hills_table(analysis: "Analysis") -> dict[str, Any]:
    """Return the cut, and what was found above it."""
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


def contact_table(analysis: "JointResult") -> dict[str, Any]:
    """Return the contact: loads and stiffness of the joint, the rest of the scan in it.

    How a scan lies under its load is in `alignment_table`.
    """
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
        "first_loading_approach_m": contact.first_loading_approach_m if contact else None,
        "first_loading_approach_without_bulk_m": (
            contact.first_loading_approach_without_bulk_m if contact else None
        ),
        "contacts": contact.contacts if contact else None,
        "stiffness_N_per_m": slip.curve.stiffness_N_per_m(slip.approach_m) if slip else None,
        "contact_area_m2": None if area_m2 is None else area_m2 * float(joint.weight[0]),
        "max_pressure_Pa": contact.max_pressure_Pa if contact else None,
        "hardness_Pa": contact.hardness_Pa if contact else hardness_Pa(analysis.settings.material),
        "yielded_area_m2": None if yielded_m2 is None else yielded_m2 * float(joint.weight[0]),
        "bulk": contact.bulk if contact else None,
        **dict.fromkeys(ALIGNMENT),
    }


def alignment_table(analysis: "Analysis") -> dict[str, Any]:
    """Return how a scanned face lies under its preload; slopes and places along x and y."""
    contact, level = analysis.contact, analysis.level
    if contact is None:
        return dict.fromkeys(ALIGNMENT)
    tilt_rad = np.add(contact.tilt_rad, (0.0, 0.0) if level is None else level.slope)
    balanced = level is not None or any(contact.tilt_rad)
    ly_m, lx_m = analysis.surface.side_m
    off_m = None if contact.eccentricity_m is None else math.hypot(*contact.eccentricity_m)
    if off_m is not None and off_m < ON_POINT * math.hypot(ly_m, lx_m):
        off_m = 0.0
    across_m = float(np.abs(tilt_rad) @ (lx_m, ly_m))
    lies = ("balanced" if balanced else "as_levelled", tilt_rad, across_m)
    values = (*lies, contact.load_point_m, contact.eccentricity_m, off_m)
    return dict(zip(ALIGNMENT, values, strict=True))


def slip_table(analysis: "JointResult") -> dict[str, Any]:
    """Return the tangential stiffness and where the joint slips as a whole."""
    slip, lay = analysis.slip, analysis.contact.lay if analysis.contact else None
    return {
        "friction_coefficient": analysis.settings.material.friction_coefficient,
        "direction_rad": analysis.settings.slip.direction_rad,
        "kappa": slip.kappa if slip else None,
        "kappa_range": lay.kappa_range if lay else None,
        "softest_direction_rad": lay.softest_rad if lay else None,
        "total_slip_force_N": slip.total_slip_force_N if slip else None,
        "total_slip_displacement_m": slip.total_slip_displacement_m if slip else None,
        "limit_G_m": _limit(analysis, "G"),
        "limit_P_m": _limit(analysis, "P"),
        "tangential_stiffness_N_per_m": slip.tangential_stiffness_N_per_m if slip else None,
    }


def damping_table(analysis: "JointResult") -> dict[str, Any]:
    """Return frequency, loss factor and energy of the structure."""
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
        "remedy": problem.remedy,
    }


def _limit(analysis: "JointResult", family: str) -> float | None:
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


def plain(value: Any) -> Any:
    """Make numpy values plain, and what is not a finite number null."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, np.ndarray):
        found = value.tolist()
        return found if value.dtype.kind in "biuf" and np.isfinite(value).all() else plain(found)
    return value
