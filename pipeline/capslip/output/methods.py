"""What a paper would say of an analysis: a paragraph on the methods, references and a citation."""

from typing import Any

from capslip.contact.rung import rung
from capslip.output.lead import oscillates
from capslip.output.quantity import engineering
from capslip.units import percent

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


def methods_paragraph(summary: dict[str, Any]) -> str:
    """Return what was done, with the numbers that make it repeatable."""
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
    found = [
        f"A scan of {nx} x {ny} points at {engineering(dx_m, 'm', 4)} x "
        f"{engineering(dy_m, 'm', 4)} was analysed with capslip {version} (settings {sha[:12]}); "
        f"the form removed was {str(surface['form']).replace('_', ' ')}.",
        f"Hills above the cut were separated by a watershed whose saddles are pruned at the noise, "
        f"and {summary['hills']['caps']} spherical caps were fitted.",
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
        found.append(
            f"Against the same elastic face pressed exactly, stiffness and energy are estimated to "
            f"within {percent(estimated)} from a tenth of gross slip on."
        )
    return " ".join(found)


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
