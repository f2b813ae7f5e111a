"""What a paper would say of an analysis: methods, what they leave out, references, a citation."""

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from capslip.contact.part_of_joint import WHOLE
from capslip.contact.rung import rung
from capslip.output.lead import mating_of, oscillates
from capslip.output.quantity import engineering
from capslip.units import percent

if TYPE_CHECKING:
    from capslip.settings import HillSettings, Settings

REFERENCES = (  # of docs/theory.md
    "Peyret, N., Chevallier, G., Dion, J.-L., Dynamic Damping in Joints: Multiscale Model Taking "
    "into Account Defects in a Nominally Plane Surface, Int. J. Appl. Mech. 8 (2016) 1650097.",
    "Ciavarella, M., J. Appl. Mech. 65 (1998) 998; Jaeger, J., J. Tribol. 120 (1998) 677.",
    "Masing, G. (1926); Iwan, W. D., J. Appl. Mech. 33 (1966) 893.",
    "Bureau, L., Caroli, C., Baumberger, T., Proc. R. Soc. A 459 (2003) 2787.",
    "Johnson, K. L., Contact Mechanics (1987).",
)
OF_MAP = ("Polonsky, I. A., Keer, L. M., Wear 231 (1999) 206.",)
OF_YIELD = (
    "Jackson, R. L., Green, I., J. Tribol. 127 (2005) 343.",
    "Tabor, D., The Hardness of Metals (1951).",
)


STEPS: dict[str, Callable[[dict[str, Any]], str]] = {  # of conditioning; "" where nothing was done
    "edge_trim": lambda step: (
        f"{step['points'][1]} columns and {step['points'][0]} rows were cut off at each edge"
    ),
    "tops": lambda step: (
        f"{step['restored']} tops that the range of the sensor had cut off were put back"
        if step["restored"]
        else ""
    ),
    "rounding": lambda step: (
        f"stored steps of {engineering(step['step_m'], 'm')} were smoothed"
        if step["smoothed"]
        else ""
    ),
    "form": lambda step: (
        f"the form removed was {_form(step)}"
        f"{', fitted to the lowest third' if step['floor'] else ''}"
        f"{', fitted robustly' if step['robust'] else ''}"
    ),
    "outliers": lambda step: (
        f"{step['removed']} points were removed as outliers" if step["removed"] else ""
    ),
    "filling": lambda step: f"{step['points']} points between measured ones were filled",
    "s_filter": lambda step: f"short waves were taken off by {_filter(step)}",
    "l_filter": lambda step: f"long waves were taken off by {_filter(step)}",
    "resampling": lambda step: (
        f"heights were resampled to {step['shape'][1]} x {step['shape'][0]} points"
    ),
}


def methods_paragraph(
    summary: dict[str, Any], settings: "Settings", error_of_answer: float | None = None
) -> str:
    """Return what was done, with the numbers that make it repeatable.

    With the error of the model at the force asked for, where that is known.
    """
    surface, contact, slip = (summary[name] for name in ("surface", "contact", "slip"))
    version, sha = summary["provenance"]["version"], summary["provenance"]["settings_sha256"]
    if surface is None:
        return (
            f"{len(summary['scans'])} scans of one joint were analysed with capslip {version} "
            f"(settings {sha[:12]}), each as if all of the joint were face as it shows. Under a "
            f"preload of {engineering(contact['preload_N'], 'N', 4)} every scan bears the nominal "
            "pressure, and under shear all share one displacement: force and energy are their "
            "sums by area. Slip under a friction coefficient of "
            f"{slip['friction_coefficient']:g} follows from the normal curves by the theorem of "
            "Ciavarella and Jaeger, cycles by Masing's rule."
        )
    (ny, nx), (dy_m, dx_m) = surface["shape"], surface["pixel_size_m"]
    mating = mating_of(surface["steps"])
    of_both = mating is not None and mating["way"] == "together"
    found = [
        f"A scan of {nx} x {ny} points at {engineering(dx_m, 'm', 4)} x "
        f"{engineering(dy_m, 'm', 4)} was analysed {'' if mating is None else 'with its mate '}"
        f"with capslip {version} (settings {sha[:12]}); {conditioned(surface['steps'])}.",
        *([] if mating is None else _mated(mating)),
        f"Hills above the cut {_separated(settings.hills, summary['hills'], of_both)}, and "
        f"{summary['hills']['caps']} spherical caps {'of both faces ' if of_both else ''}"
        "were fitted.",
    ]
    if contact["model"] is None:
        return " ".join(found)
    level = "turned until its contacts balanced about the load point, and was "
    found.append(
        f"The face was {level if contact['alignment'] == 'balanced' else ''}pressed under "
        f"{engineering(contact['preload_N'], 'N', 4)} per joint with the contact model "
        f"{rung(contact['model']).label}."
    )
    if contact["hardness_Pa"] is not None:
        found.append(
            f"It yielded at a hardness of {engineering(contact['hardness_Pa'], 'Pa')} as it was "
            "loaded, and unloads elastically."
        )
    cycles = "cycles by Masing's rule"
    if oscillates(summary):
        cycles = "cycles under a normal load that oscillates level by level of that load"
    found.append(
        f"Slip under a friction coefficient of {slip['friction_coefficient']:g} follows from the "
        f"normal curve by the theorem of Ciavarella and Jaeger, {cycles}."
    )
    estimated = summary["accuracy"]["estimated"]
    if estimated is not None:
        most = f"{percent(estimated)} from a tenth of gross slip on"
        within = most
        if error_of_answer is not None and percent(error_of_answer) != percent(estimated):
            within = f"{percent(error_of_answer)} at the force asked for (to within {most})"
        found.append(
            f"Against the same {_face(contact)} pressed exactly, stiffness and energy are "
            f"estimated to within {within}."
        )
    return " ".join(found)


def _face(contact: dict[str, Any]) -> str:
    return "elastic face" if contact["hardness_Pa"] is None else "face with its hardness"


def conditioned(steps: Iterable[dict[str, Any]]) -> str:
    """Return what was done to one map, in its order."""
    return "; ".join(filter(None, (STEPS.get(step["step"], lambda _: "")(step) for step in steps)))


def _form(step: dict[str, Any]) -> str:
    """Return the form of a step; of a polynomial its degree."""
    return (
        f"polynomial of degree {step['degree']}" if step["kind"] == "polynomial" else step["kind"]
    )


def _filter(step: dict[str, Any]) -> str:
    """Return the filter of a step."""
    index = engineering(step["nesting_index_m"], "m", 4)
    return f"an areal Gaussian filter (ISO 16610-61) with a nesting index of {index}"


def limits(summary: dict[str, Any]) -> list[str]:
    """Say in plain words what the model leaves out."""
    load = "a constant preload"
    if oscillates(summary):
        load = "a normal load that oscillates with the force and its frequency, once it has settled"
    found = [
        "The loss factor is for comparing faces, preloads and designs. Bureau, Caroli and "
        "Baumberger (2003) report that a model of many Mindlin contacts describes the elastic "
        "response of a real interface, but not its dissipation quantitatively. An absolute value "
        "needs a measurement, and no interval of this report holds that: they hold what the caps, "
        "the contact model and the given spreads leave open.",
        "Slip follows from the normal curve by the theorem of Ciavarella and Jaeger: "
        f"{load}, one direction of slip, no rotation, equal materials (or no coupling between "
        "normal and tangential deformation), Coulomb friction with one coefficient. Poisson's "
        "effect alone (at 0.3) changes displacement and energy by 0.1 and 0.4 % for one round "
        "contact, by up to 5 and 11 % for waves that leave few contacts.",
    ]
    model = summary["contact"]["model"]
    if model is not None:
        found.append(f"Contact model {model}: {rung(model).leaves_out}")
        how = "holds" if summary["contact"]["bulk"] else "does not hold"
        found.append(
            f"The stiffness used {how} the sinking of the half-space as a whole (the bulk term). A "
            "structural model of the parts counts that sinking itself."
        )
    hardness_Pa = summary["contact"]["hardness_Pa"]
    found.append(
        "The contact is elastic: no hardness was given."
        if hardness_Pa is None
        else f"The hardness of the softer face is taken as {hardness_Pa / 1e9:.3g} GPa everywhere; "
        "2.8 times a yield stress is known to some 20 %, less where machining hardened the skin."
    )
    coverage = summary["contact"]["coverage"]
    if coverage is not None and coverage < WHOLE:
        found.append(
            "The scan stands for a larger joint: waves longer than the scan are not in the "
            "numbers, and its few highest hills stand for those of the whole. A face cut in nine "
            "lost less than in one piece, by about one over the root of the contacts in a part, "
            "and from part to part it scattered by as much. The intervals hold that."
        )
    found.append(
        "Only the loss in the joints is counted: not that in the material, at "
        "the clamps or in the air."
    )
    return found


def _mated(step: dict[str, Any]) -> list[str]:
    """Return what was done to the second face, and how both became one."""
    dy_m, dx_m = step["offset_m"]
    at = f"{engineering(dx_m, 'm', 4)} along x and {engineering(dy_m, 'm', 4)} along y"
    found = "" if step["correlation"] is None else ", where the sum of both varies least"
    both = "the heights of both were added, on the finer points of the two"
    if step["way"] == "together":
        both = "each was cut by itself, against a plane, and the caps of both were counted"
    return [
        f"Of the second scan, {step['second']}: {conditioned(step['second_steps'])}.",
        f"It was mirrored in {step['mirror']}, turned by "
        f"{math.degrees(step['rotation_rad']):.4g} degrees and shifted by {at}{found}; {both}.",
    ]


def _separated(chosen: "HillSettings", hills: dict[str, Any], of_both: bool) -> str:
    """Return how hills were told apart."""
    if chosen.separation == "regions":
        return "are its connected regions (eight neighbours), not pruned"
    height = engineering(hills["pruning_height_m"], "m")
    if chosen.pruning_height_m is not None:
        height += " (given)"
    else:
        share, of_first = chosen.pruning_percent_Sz, ", of the first" if of_both else ""
        height += f" ({'from the map' if share is None else f'{share:g} % of Sz'}{of_first})"
    return (
        f"were separated by a watershed, where those that rise by less than {height} above their "
        "saddle belong to their neighbour"
    )


def references(summary: dict[str, Any]) -> list[str]:
    """Return what the paragraph rests on."""
    contact, found = summary["contact"], [*REFERENCES]
    if contact["model"] is not None and rung(contact["model"]).made_from == "map":
        found += OF_MAP
    return [*found, *OF_YIELD] if contact["hardness_Pa"] is not None else found


def citation(summary: dict[str, Any]) -> str:
    """Return how to cite the program."""
    year = summary["provenance"]["started"][:4]
    version = summary["provenance"]["version"]
    return (
        f"The capslip developers: capslip {version}, from a scan of a joint face to its damping "
        f"({year}); with reference 1."
    )
