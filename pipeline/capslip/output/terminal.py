"""The results as one reads them on a terminal."""

from typing import TYPE_CHECKING

from capslip.output.quantity import contact_name
from capslip.surface.doubts import sanity_line

if TYPE_CHECKING:
    from capslip.result import Analysis


def result_lines(analysis: "Analysis") -> str:
    """Return the results as a dozen lines in engineering units."""
    hills, families = analysis.hills, analysis.families
    conditioned = analysis.conditioned
    um = 1e6
    lines = [
        f"scan       {sanity_line(conditioned.surface, conditioned.sq_m, conditioned.sz_m)}",
        f"hills      cut {hills.cut_height_m * um:.4g} um, {hills.n_regions} regions, "
        f"{hills.n_hills} hills, {int(analysis.caps.usable.sum())} caps, "
        f"largest region {100 * hills.largest_region_share:.0f} %",
    ]
    h = "-" if families.h_m is None else f"{families.h_m * um:.4g} um"
    lines.append(f"families   m {families.m}, n {families.n}, h {h}")
    for name, family in (("G", families.G), ("P", families.P)):
        if family is not None:
            lines.append(
                f"  {name}        R {family.radius_m:.4g} m, D {family.diameter_m * 1e3:.4g} mm, "
                f"df {family.height_m * um:.4g} um"
            )
    contact, slip, damping = analysis.contact, analysis.slip, analysis.damping
    if contact is not None:
        without_m = contact.approach_without_bulk_m
        without = "" if without_m is None else f" ({without_m * um:.4g} um without bulk)"
        lines.append(
            f"contact    {contact.model}: {contact.preload_N:g} N on {contact.contacts} "
            f"{contact_name(contact.model)}, approach {contact.approach_m * um:.4g} um{without}"
        )
    if slip is not None:
        lines.append(
            f"slip       stiffness {slip.tangential_stiffness_N_per_m / 1e6:.4g} MN/m, total slip "
            f"at {slip.total_slip_force_N:.4g} N, {slip.total_slip_displacement_m * 1e9:.4g} nm"
        )
    if damping is not None and damping.amplitude_at_peak_m is None:
        lines.append(
            f"damping    no loss below gross slip at {damping.gross_slip_amplitude_m * um:.4g} um"
        )
    elif damping is not None:
        lines.append(
            f"damping    peak loss factor {damping.peak_loss_factor:.4g} at "
            f"{(damping.amplitude_at_peak_m or 0.0) * um:.4g} um, gross slip at "
            f"{damping.gross_slip_amplitude_m * um:.4g} um"
        )
    lines.append(f"status     {analysis.status}")
    lines += [f"  {p.severity:8} {p.code}: {p.message}" for p in analysis.problems]
    return "\n".join(lines)
