"""What makes a result doubtful: said beside the numbers, never left to the reader to find."""

import math

import numpy as np

from capslip.caps.doubts import VISIBLE_FORM
from capslip.caps.families import Families
from capslip.caps.pruning import MIN_POINTS
from capslip.caps.table import CapFlag, CapTable
from capslip.contact.material import composite, dundurs_beta
from capslip.contact.model_choice import BEYOND_SHARE
from capslip.problems import Problem, Severity
from capslip.settings import Beam, Settings
from capslip.structure.response import Damping
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap

MIN_PIXELS_ACROSS = 4.0  # of the contacts that carry the lighter half of the load
LARGE_BETA = 0.1  # beyond: compliances change by beta^2, more than 1 %, and much slips early
LARGE_FRICTION = 1.5
ELASTIC_STRAIN = 0.03  # of E*: the greatest pressure at which the hardest steels stay elastic


def doubts_of_scan(surface: HeightMap) -> list[Problem]:
    """Return what makes the map as measured doubtful; levelling would hide a flat top."""
    height_m = surface.height_m[surface.measured]
    if height_m.size == 0:
        return []
    top_m = height_m.max()
    n_top = int(np.count_nonzero(height_m == top_m))
    below_m = height_m[height_m < top_m]
    if n_top < MIN_POINTS or below_m.size == 0:
        return []
    if n_top <= 4 * np.count_nonzero(below_m == below_m.max()):
        return []  # quantised: the next level holds as many
    message = (
        f"{n_top} points share the greatest height: the sensor cut the peaks off, and the caps are "
        "higher than they look"
    )
    return [Problem("clipped", "warning", message)]


def doubts_of_settings(settings: Settings) -> list[Problem]:
    """Return what in the settings is hardly meant, or beyond what the model describes."""
    found: list[Problem] = []
    material, structure = settings.material, settings.structure
    beta = dundurs_beta(material.youngs_modulus_Pa, material.poisson_ratio)
    if abs(beta) > LARGE_BETA:
        message = (
            f"Dundurs' beta of the two materials is {beta:.2g}: pressure alone shears such "
            f"contacts, by about {abs(beta) / material.friction_coefficient:.0%} of their "
            "friction, which the slip curve leaves out (exact only at beta = 0, equal materials)"
        )
        found.append(Problem("materials_coupled", "warning", message))
    if material.friction_coefficient > LARGE_FRICTION:
        message = (
            f"material.friction_coefficient is {material.friction_coefficient:g}; dry engineering "
            f"faces have 0.05 to {LARGE_FRICTION:g}"
        )
        found.append(Problem("friction_suspect", "warning", message))
    if structure.modal_stiffness_N_per_m is not None and structure.beam != Beam():
        message = (
            "structure.beam is not used: the structure's two stiffnesses are given; leave out the "
            "one or the other"
        )
        found.append(Problem("beam_ignored", "warning", message))
    return found


def doubts_of_tilt(surface: HeightMap, approach_m: float) -> list[Problem]:
    """Return whether a tilt was left in that decides what touches."""
    level, _ = remove_form(surface, "plane")
    tilt_m = float(np.ptp((surface.height_m - level.height_m)[surface.measured]))
    if tilt_m <= VISIBLE_FORM * approach_m:
        return []
    message = (
        f"the levelling decides which caps touch: nothing was taken off the face, and its "
        f"least-squares plane is tilted by {tilt_m:.3g} m, the approach is {approach_m:.3g} m. "
        "Where that is how the face lay under the instrument, conditioning.form = plane takes it "
        "off; where it is the face's own, as caps on one side tilt that plane, leave it"
    )
    return [Problem("tilt_left", "warning", message)]


def doubts_of_contact(
    caps: CapTable,
    families: Families,
    n_contacts: int,
    n_overlaps: int,
    max_pressure_Pa: float | None,
    pixel_area_m2: float,
    damping: Damping,
    settings: Settings,
) -> list[Problem]:
    """Return what makes the contact, or the damping that follows from it, doubtful."""
    found: list[Problem] = []

    def doubt(code: str, message: str, severity: Severity = "warning") -> None:
        found.append(Problem(code, severity, message))

    loaded = caps.load_N > 0  # nowhere for a model without caps
    if n_contacts == 1 and loaded.any():
        doubt("one_contact", "one cap carries the whole preload")
    if families.P is not None and loaded.any() and not loaded[caps.family == "P"].any():
        doubt("P_not_in_contact", "no P-cap touches under this preload", "info")
    if n_overlaps:
        doubt(
            "contacts_merge",
            f"{n_overlaps} pairs of contacts overlap: the caps do not hold at this preload",
        )
    load_N = np.where(loaded, caps.load_N, 0.0)
    beyond = loaded & (caps.contact_radius_m > 0.5 * caps.diameter_m)
    if beyond.any():
        doubt(
            "contact_beyond_cap",
            f"{int(beyond.sum())} contacts are wider than the hill that the cap was fitted to",
            "warning" if load_N[beyond].sum() > BEYOND_SHARE * load_N.sum() else "info",
        )
    doubtful = CapFlag.edge | CapFlag.non_measured | CapFlag.apex_off_surface | CapFlag.noisy_apex
    share = load_N[(caps.flags & doubtful) != 0].sum() / max(load_N.sum(), 1e-300)
    depth_m = 0.5 * caps.contact_radius_m**2 / caps.radius_m
    deep = loaded & (depth_m > 1.001 * caps.cap_height_m)  # no fit goes below the cut
    low = loaded & (caps.cap_height_m < 0.1 * np.nanmax(caps.cap_height_m))
    if load_N[deep].sum() > 0.05 * load_N.sum() or low.any():
        doubt(
            "contact_reaches_below_cut",
            "the contact reaches down to the cut: hills below it may touch too, and caps are "
            "fitted too shallow; raise hills.material_ratio",
        )
    if loaded.any():
        radius_m = caps.contact_radius_m[loaded]
        order = np.argsort(radius_m)
        carried_N = np.cumsum(caps.load_N[loaded][order])
        half_m = radius_m[order][np.searchsorted(carried_N, 0.5 * carried_N[-1])]
        across = 2.0 * half_m / math.sqrt(pixel_area_m2)
        if across < MIN_PIXELS_ACROSS:
            doubt(
                "contact_under_resolved",
                f"half of the load rests on contacts of at most {across:.2g} pixels across: a "
                "dozen points or fewer; check units, or use a finer scan",
            )
    if share > 0.2:
        doubt("load_on_doubtful_caps", f"{share:.0%} of the preload rests on flagged caps")
    yield_Pa = settings.material.yield_stress_Pa
    if yield_Pa is not None and max_pressure_Pa is not None and max_pressure_Pa > 1.6 * yield_Pa:
        doubt(
            "plastic",
            f"the greatest contact pressure {max_pressure_Pa / 1e6:.4g} MPa exceeds 1.6 times the "
            f"yield stress {yield_Pa / 1e6:.4g} MPa: the elastic model does not hold",
        )
    if yield_Pa is None and max_pressure_Pa is not None:
        joint = composite(settings.material.youngs_modulus_Pa, settings.material.poisson_ratio)
        if max_pressure_Pa > ELASTIC_STRAIN * joint.E_star_Pa:
            doubt(
                "pressure_beyond_elastic",
                f"the greatest contact pressure {max_pressure_Pa / 1e9:.3g} GPa is more than any "
                "engineering metal bears elastically; check preload and units, or give "
                "material.yield_stress_Pa",
            )
    if damping.peak_loss_factor > 0.3:
        doubt(
            "not_lightly_damped",
            f"the loss factor reaches {damping.peak_loss_factor:.2g}: the mode is no longer "
            "lightly damped there, and the amplitudes do not follow from its stiffness alone",
        )
    if damping.peak_at_gross_slip:
        doubt("peak_at_gross_slip", "the loss factor still grows where gross slip begins", "info")
    return found
