"""The one table of what is reported: each quantity with its label, unit and place in the summary.

Report, terminal and batch take their numbers from here. A text names a quantity in braces, and
after a colon how it is written: `"cut {cut_height_m:um}"`.
"""

import math
from dataclasses import dataclass
from typing import Any

from capslip.output.quantity import engineering
from capslip.units import AREAS

DASH = "–"
UNEVEN = ", under the greatest pressure"  # that of the patch whose state is shown
SCALES = {
    "um": 1e-6,
    "µm": 1e-6,
    "nm": 1e-9,
    "nJ": 1e-9,
    "mm": 1e-3,
    "µm²": 1e-12,
    "mm²": 1e-6,
    "cm²": 1e-4,
    "MN/m": 1e6,
    "%": 1e-2,
    "°": math.pi / 180.0,
    "1/mm": 1e3,
    "1/mm²": 1e6,
}


@dataclass(frozen=True)
class Quantity:
    """One quantity of a result.

    Attributes
    ----------
    label : str
        Its name in a table.
    unit : str
        SI unit of its value; "%" for a share that is written in percent, "" for counts and words.
    path : str
        Its place in the summary.
    """

    label: str
    unit: str
    path: str


def _interval(place: str, name: str, label: str, unit: str) -> dict[str, Quantity]:
    """Return both ends of the interval of a number of the answer."""
    stem, _, of_unit = place.partition(":")
    return {
        f"{name}_{end}{of_unit}": Quantity(
            f"{label}, {words}", unit, f"answer.interval.{stem}{of_unit}.{i}"
        )
        for i, (end, words) in enumerate((("low", "5 %"), ("high", "95 %")))
    }


def _of_family(name: str) -> dict[str, Quantity]:
    place = f"families.{name}"
    return {
        f"count_{name}": Quantity(f"{name}-caps", "", f"{place}.count"),
        f"radius_{name}_m": Quantity("mean R", "m", f"{place}.radius_m"),
        f"diameter_{name}_m": Quantity("D", "m", f"{place}.diameter_m"),
        f"height_{name}_m": Quantity("df", "m", f"{place}.height_m"),
        f"peak_height_{name}_m": Quantity("peak height", "m", f"{place}.peak_height_m"),
    }


def _iso(name: str, label: str, unit: str = "") -> dict[str, Quantity]:
    """Return a parameter of ISO 25178-2."""
    return {name: Quantity(label, unit, f"surface.iso25178.{name}")}


QUANTITIES = {
    "verdict": Quantity("verdict", "", "verdict"),
    "path": Quantity("file", "", "surface.path"),
    "sha256": Quantity("SHA-256", "", "surface.sha256"),
    "non_measured": Quantity("non-measured", "%", "surface.non_measured_fraction"),
    "form": Quantity("form removed", "", "surface.form"),
    "sq_m": Quantity("Sq", "m", "surface.sq_m"),
    "sz_m": Quantity("Sz", "m", "surface.sz_m"),
    **_iso("Sa_m", "Sa, mean absolute height", "m"),
    **_iso("Sq_m", "Sq, root mean square height", "m"),
    **_iso("Ssk", "Ssk, skewness"),
    **_iso("Sku", "Sku, kurtosis"),
    **_iso("Sp_m", "Sp, highest peak", "m"),
    **_iso("Sv_m", "Sv, deepest pit", "m"),
    **_iso("Sz_m", "Sz, height range", "m"),
    **_iso("Sal_m", "Sal, autocorrelation length", "m"),
    **_iso("Str", "Str, texture aspect ratio"),
    **_iso("Std_rad", "Std, direction of the greatest power", "rad"),
    **_iso("hills_at_5_percent", "hills after Wolf pruning at 5 % of Sz"),
    **_iso("closed_hills", "of them closed"),
    **_iso("Spd_per_m2", "Spd, density of closed hills", "1/m^2"),
    **_iso("Spc_per_m", "Spc, mean curvature of their peaks", "1/m"),
    **_iso("S5p_m", "S5p, mean height of the highest five", "m"),
    **_iso("S10z_m", "S10z, S5p and the mean depth of the five lowest pits", "m"),
    **_iso("Sha_m2", "Sha, mean area of closed hills", "m^2"),
    **_iso("Sda_m2", "Sda, mean area of closed dales", "m^2"),
    "shortest_wave_m": Quantity("shortest wave carried", "m", "surface.iso25178.carried_waves_m.0"),
    "longest_wave_m": Quantity("longest wave carried", "m", "surface.iso25178.carried_waves_m.1"),
    **_iso("contact_diameter_m", "width of contacts that carry half of the load", "m"),
    "material_ratio": Quantity("material ratio of the cut", "%", "hills.material_ratio"),
    "cut_height_m": Quantity("cut height", "m", "hills.cut_height_m"),
    "kept_fraction": Quantity("points kept", "%", "hills.kept_fraction"),
    "regions": Quantity("regions above the cut", "", "hills.regions"),
    "largest_region_share": Quantity(
        "share of the largest region", "%", "hills.largest_region_share"
    ),
    "hills": Quantity("hills", "", "hills.hills"),
    "caps": Quantity("caps on the map", "", "hills.caps"),
    "m": Quantity("m on the families' own plane", "", "families.m"),
    "n": Quantity("n on the families' own plane", "", "families.n"),
    "h_m": Quantity("height difference h", "m", "families.h_m"),
    **_of_family("G"),
    **_of_family("P"),
    "cut_certified": Quantity("cut holds all that touches", "", "hills.cut_certified"),
    "alignment": Quantity("alignment", "", "contact.alignment"),
    "tilt_across_face_m": Quantity("tilt across the face", "m", "contact.tilt_across_face_m"),
    "nominal_pressure_Pa": Quantity("nominal pressure", "Pa", "contact.nominal_pressure_Pa"),
    "coverage": Quantity("scan over joint", "%", "contact.coverage"),
    "joint_area_m2": Quantity("area of the joint", "m^2", "contact.joint_area_m2"),
    "off_m": Quantity("resultant off the load point", "m", "contact.resultant_off_load_point_m"),
    "model": Quantity("contact model", "", "contact.model"),
    "preload_N": Quantity("preload", "N", "contact.preload_N"),
    "scan_load_N": Quantity("load of the scan", "N", "contact.scan_load_N"),
    "approach_m": Quantity(
        "elastic approach, recovered on unloading, with bulk", "m", "contact.approach_m"
    ),
    "approach_without_bulk_m": Quantity("normal approach", "m", "contact.approach_without_bulk_m"),
    "first_loading_approach_m": Quantity(
        "approach on first loading with bulk", "m", "contact.first_loading_approach_m"
    ),
    "first_loading_approach_without_bulk_m": Quantity(
        "approach on first loading", "m", "contact.first_loading_approach_without_bulk_m"
    ),
    "contacts": Quantity("contacts", "", "contact.contacts"),
    "stiffness_N_per_m": Quantity("normal stiffness", "N/m", "contact.stiffness_N_per_m"),
    "contact_area_m2": Quantity("contact area", "m^2", "contact.contact_area_m2"),
    "max_pressure_Pa": Quantity("greatest pressure", "Pa", "contact.max_pressure_Pa"),
    "hardness_Pa": Quantity("hardness", "Pa", "contact.hardness_Pa"),
    "yielded_area_m2": Quantity("yielded area", "m^2", "contact.yielded_area_m2"),
    "model_reason": Quantity("reason for the model", "", "accuracy.model_reason"),
    "friction_coefficient": Quantity("friction coefficient", "", "slip.friction_coefficient"),
    "total_slip_force_N": Quantity("force at gross slip", "N", "slip.total_slip_force_N"),
    "total_slip_displacement_m": Quantity(
        "displacement at gross slip", "m", "slip.total_slip_displacement_m"
    ),
    "limit_G_m": Quantity("all G-caps slide from", "m", "slip.limit_G_m"),
    "limit_P_m": Quantity("all P-caps slide from", "m", "slip.limit_P_m"),
    "tangential_stiffness_N_per_m": Quantity(
        "tangential stiffness", "N/m", "slip.tangential_stiffness_N_per_m"
    ),
    "answer_structure": Quantity("structure", "", "answer.structure"),
    "answer_force_N": Quantity("slip force", "N", "answer.slip_force_N"),
    "answer_displacement_m": Quantity("displacement of the joint", "m", "answer.displacement_m"),
    "answer_stiffness_N_per_m": Quantity(
        "tangential stiffness (secant)", "N/m", "answer.tangential_stiffness_N_per_m"
    ),
    "answer_energy_J": Quantity("energy lost per cycle", "J", "answer.energy_J"),
    "answer_joint_loss_factor": Quantity(
        "loss factor of the joint", "", "answer.joint_loss_factor"
    ),
    "answer_amplitude_m": Quantity("amplitude of the structure", "m", "answer.amplitude_m"),
    "answer_loss_factor": Quantity("loss factor of the structure", "", "answer.loss_factor"),
    "answer_damping_ratio": Quantity("damping ratio of the structure", "", "answer.damping_ratio"),
    "answer_frequency_shift": Quantity("frequency shift", "%", "answer.frequency_shift"),
    "answer_total_amplitude_m": Quantity(
        "amplitude with the slip of the joints", "m", "answer.total_amplitude_m"
    ),
    "answer_total_loss_factor": Quantity(
        "loss factor of the whole", "", "answer.total_loss_factor"
    ),
    **_interval("tangential_stiffness:_N_per_m", "answer_stiffness", "stiffness", "N/m"),
    **_interval("energy:_J", "answer_energy", "energy", "J"),
    **_interval("joint_loss_factor", "answer_joint_loss_factor", "loss factor of the joint", ""),
    **_interval("loss_factor", "answer_loss_factor", "loss factor of the structure", ""),
    "structure": Quantity("structure", "", "damping.structure"),
    "peak_loss_factor": Quantity("greatest loss factor", "", "damping.peak_loss_factor"),
    "amplitude_at_peak_m": Quantity("amplitude there", "m", "damping.amplitude_at_peak_m"),
    "first_peak_loss_factor": Quantity(
        "first maximum of the loss factor", "", "damping.first_peak_loss_factor"
    ),
    "amplitude_at_first_peak_m": Quantity(
        "amplitude there", "m", "damping.amplitude_at_first_peak_m"
    ),
    "gross_slip_amplitude_m": Quantity(
        "amplitude at gross slip", "m", "damping.gross_slip_amplitude_m"
    ),
    "modal_stiffness_N_per_m": Quantity(
        "modal stiffness", "N/m", "damping.modal_stiffness_N_per_m"
    ),
    "joint_stiffness_N_per_m": Quantity(
        "joint stiffness", "N/m", "damping.joint_stiffness_N_per_m"
    ),
    "joints": Quantity("joints", "", "damping.joints"),
}


@dataclass(frozen=True)
class Value:
    """A value that writes itself: `{:}`, `{:4}` (digits), `{:um}`, `{:.3g %}` (in that unit)."""

    value: Any
    unit: str = ""
    absent: str = DASH

    def __format__(self, spec: str) -> str:
        """Write the value; an absent one is `absent`, whatever the specification."""
        if self.value is None:
            return self.absent
        if isinstance(self.value, bool):
            return "yes" if self.value else "no"
        shape, _, unit = spec.rpartition(" ")
        if unit in SCALES or shape:
            return f"{self.value / SCALES.get(unit, 1.0):{shape or '.4g'}} {unit}"
        if spec and not spec.isdigit():
            return format(self.value, spec)
        if self.unit == "m^2":  # prefixes of a square mislead
            name = next(name for least_m2, _, name in AREAS if self.value >= least_m2)
            return format(self, f".3g {name.replace('2', '²').replace('u', 'µ')}")
        if self.unit == "%":
            return f"{self:.3g %}"
        if self.unit:
            return engineering(self.value, self.unit, int(spec or 3))
        return f"{self.value:.3g}" if isinstance(self.value, float) else str(self.value)


def value(summary: dict[str, Any], name: str) -> Any:
    """Return a quantity of a summary in SI; None where the analysis did not come so far.

    Examples
    --------
    >>> value({"families": {"h_m": 3e-7, "G": None}}, "h_m")
    3e-07
    >>> value({"families": {"h_m": 3e-7, "G": None}}, "radius_G_m") is None
    True
    """
    found: Any = summary
    for key in QUANTITIES[name].path.split("."):
        if found is not None:
            found = found[int(key)] if isinstance(found, list) else found[key]
    return found


def approach_fact(contact: dict[str, Any]) -> tuple[str | tuple[str, str], str]:
    """Return quantity, or label and text, and note of how far the faces came together.

    Of a face that yielded the approach of the curves is what it recovers on unloading.
    """
    if contact["first_loading_approach_m"] == contact["approach_m"]:
        return "approach_without_bulk_m", "without bulk; {approach_m} with it"
    if contact["first_loading_approach_m"] is None:
        recovery = "recovery on unloading", "{approach_without_bulk_m}"
        return recovery, "without bulk; {approach_m} with it"
    note = "without bulk; {first_loading_approach_m} with it; recovers {approach_without_bulk_m}"
    return "first_loading_approach_without_bulk_m", note


def write_text(template: str, summary: dict[str, Any], absent: str = DASH) -> str:
    """Fill a text that names quantities in braces with the values of a summary.

    Examples
    --------
    >>> summary = {"families": {"m": 2, "h_m": 2.4e-7}, "hills": {"kept_fraction": 0.1}}
    >>> write_text("{m} caps, {h_m} = {h_m:.2f um}, {kept_fraction} kept", summary)
    '2 caps, 240 nm = 0.24 um, 10 % kept'
    """
    return template.format_map(_Values(summary, absent))


class _Values(dict[str, Value]):
    """Looks a quantity up when a text names it."""

    def __init__(self, summary: dict[str, Any], absent: str) -> None:
        self.summary, self.absent = summary, absent

    def __missing__(self, name: str) -> Value:
        return Value(value(self.summary, name), QUANTITIES[name].unit, self.absent)
