"""The dictionary of `summary.json`: every key present, absent values null, units in the names."""

import math
import platform
from typing import TYPE_CHECKING, Any

import numpy as np

import capslip

if TYPE_CHECKING:
    from capslip.analysis import Analysis
    from capslip.caps.families import Family

SCHEMA = "capslip/summary/1"


def summarise(
    analysis: "Analysis", command: str | None = None, timings_s: dict[str, float] | None = None
) -> dict[str, Any]:
    """Collect the results of one analysis.

    Parameters
    ----------
    analysis : Analysis
        Any analysis; stages that could not run give null.
    command : str, optional
        The command line, for the record.
    timings_s : dict, optional
        Seconds of what was done outside the analysis (reading, drawing, ...).

    Returns
    -------
    dict
        Plain numbers, strings, lists and dictionaries, ready for JSON.
    """
    settings, surface = analysis.settings, analysis.surface
    hills, caps, families = analysis.hills, analysis.caps, analysis.families
    contact, slip, damping = analysis.contact, analysis.slip, analysis.damping
    usable = int(caps.usable.sum())
    rejected = dict(hills.rejected)
    if usable < len(caps):
        rejected["no_sphere"] = len(caps) - usable
    table: dict[str, Any] = {
        "schema": SCHEMA,
        "name": surface.origin.name,
        "status": analysis.status,
        "surface": {
            "path": surface.origin.path,
            "sha256": surface.origin.sha256,
            "shape": list(surface.shape),
            "pixel_size_m": list(surface.pixel_size_m),
            "non_measured_fraction": 1.0 - surface.measured.mean(),
            "sq_m": analysis.conditioned.sq_m,
            "sz_m": analysis.conditioned.sz_m,
            "form": settings.conditioning.form,
            "steps": list(analysis.conditioned.steps),
            "format": surface.origin.file_format,
            "height_unit": surface.origin.height_unit,
            "lateral_unit": surface.origin.lateral_unit,
        },
        "hills": {
            "material_ratio": settings.hills.material_ratio,
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
        },
        "families": {
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
        },
        "contact": {
            "model": contact.model if contact else None,
            "preload_N": settings.contact.preload_N,
            "approach_m": contact.approach_m if contact else None,
            "approach_without_bulk_m": contact.approach_without_bulk_m if contact else None,
            "contacts": contact.contacts if contact else None,
            "stiffness_N_per_m": contact.stiffness_N_per_m if contact else None,
            "contact_area_m2": contact.contact_area_m2 if contact else None,
            "max_pressure_Pa": contact.max_pressure_Pa if contact else None,
            "bulk": contact.bulk if contact else None,
        },
        "slip": {
            "friction_coefficient": settings.material.friction_coefficient,
            "total_slip_force_N": slip.total_slip_force_N if slip else None,
            "total_slip_displacement_m": slip.total_slip_displacement_m if slip else None,
            "limit_G_m": _limit(analysis, "G"),
            "limit_P_m": _limit(analysis, "P"),
            "tangential_stiffness_N_per_m": slip.tangential_stiffness_N_per_m if slip else None,
        },
        "damping": {
            "amplitude_m": damping.amplitude_m if damping else [],
            "loss_factor": damping.loss_factor if damping else [],
            "damping_ratio": damping.damping_ratio if damping else [],
            "frequency_ratio": damping.frequency_ratio if damping else [],
            "peak_loss_factor": damping.peak_loss_factor if damping else None,
            "amplitude_at_peak_m": damping.amplitude_at_peak_m if damping else None,
            "gross_slip_amplitude_m": damping.gross_slip_amplitude_m if damping else None,
            "modal_stiffness_N_per_m": damping.modal_stiffness_N_per_m if damping else None,
            "joint_stiffness_N_per_m": damping.joint_stiffness_N_per_m if damping else None,
            "joints": settings.structure.joints,
        },
        "accuracy": {
            "requested": settings.contact.tolerance,
            "estimated": contact.estimated_error if contact else None,
            "model_reason": contact.model_reason if contact else None,
        },
        "sensitivity": analysis.sensitivity.to_dict() if analysis.sensitivity else None,
        "problems": [
            {"code": p.code, "severity": p.severity, "message": p.message}
            for p in analysis.problems
        ],
        "timings_s": {**analysis.timings_s, **(timings_s or {})},
        "provenance": {
            "version": capslip.__version__,
            "python": platform.python_version(),
            "platform": platform.platform(),
            "command": command,
            "settings_sha256": settings.sha256(),
            "started": analysis.started,
        },
    }
    plain: dict[str, Any] = _plain(table)
    return plain


def _limit(analysis: "Analysis", family: str) -> float | None:
    """Return the displacement at which the last cap of a family slips as a whole."""
    contact, slip = analysis.contact, analysis.slip
    if contact is None or slip is None or contact.model in ("flat", "boundary_elements"):
        return None
    names = analysis.caps.family[contact.use]
    if contact.model == "families":
        names = np.array(["G", "P"])[: analysis.families.count]
    limits_m = slip.limits_m[(names == family) & np.isfinite(slip.limits_m)]
    return float(limits_m.max()) if limits_m.size else None


def _family(family: "Family | None") -> dict[str, Any] | None:
    if family is None:
        return None
    return {
        "count": family.count,
        "radius_m": family.radius_m,
        "radius_se_m": family.radius_se_m,
        "mean_radius_m": family.mean_radius_m,
        "diameter_m": family.diameter_m,
        "height_m": family.height_m,
        "peak_height_m": family.peak_height_m,
        "peak_height_se_m": family.peak_height_se_m,
    }


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
