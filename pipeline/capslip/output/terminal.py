"""The results as one reads them on a terminal."""

import math

from capslip.errors import printable
from capslip.output.lead import answer_lines, assumed_lines, joint_line
from capslip.output.rows import write_text
from capslip.result import Analysis, JointResult
from capslip.surface.doubts import sanity_line

HILLS = (
    "hills      cut {cut_height_m:um}, {regions} regions, {hills} hills, {caps} caps, largest "
    "region {largest_region_share:.0f %}"
)
FAMILIES = "families   m {m}, n {n}, h {h_m:um}"
FAMILY = "  {0}        R {{radius_{0}_m:.4g m}}, D {{diameter_{0}_m:mm}}, df {{height_{0}_m:um}}"
LEVEL = "level      turned by {tilt_across_face_m:nm} across the face until balanced{0}"
NOT_CERTIFIED = "; the cut does not hold all that touches"
CONTACT = (
    "contact    {{model}}: {{scan_load_N:g N}} on {{contacts}} {0}, approach {{approach_m:um}}"
)
WITHOUT_BULK = " ({approach_without_bulk_m:um} without bulk)"
SLIP = (
    "slip       stiffness {0}, total slip at {{total_slip_force_N:.4g N}}, "
    "{{total_slip_displacement_m:nm}}"
)
STIFFNESS = "{tangential_stiffness_N_per_m:MN/m}"  # null in the summary where it is infinite
NO_LOSS = "damping    {structure}: no loss below gross slip at {gross_slip_amplitude_m:um}"
NOT_DEFINED = (
    "damping    {structure}: no longer lightly damped at its peak, gross slip at "
    "{gross_slip_amplitude_m:um}"
)
DAMPING = (
    "damping    {structure}: peak loss factor {peak_loss_factor:.4g} at {amplitude_at_peak_m:um}, "
    "gross slip at {gross_slip_amplitude_m:um}"
)
FIRST_PEAK = "; first maximum {first_peak_loss_factor:.4g} at {amplitude_at_first_peak_m:um}"


def result_lines(analysis: JointResult) -> str:
    """Return the results as one screen: the verdict, the answer, what was assumed, the rest."""
    summary = analysis.summary()
    lead = [("verdict", summary["verdict"]), *answer_lines(summary, "-")]
    lead.append(("joint", joint_line(summary, "-")))
    assumed = [f"{name} {value}: moves {moves}" for name, value, moves in assumed_lines(summary)]
    lead += zip(["assumed", *[""] * len(assumed)], assumed, strict=False)
    lines = [f"{label:10} {text}".replace("µ", "u") for label, text in lead]
    contact, slip, damping = analysis.contact, analysis.slip, analysis.damping
    texts = [HILLS, FAMILIES] if isinstance(analysis, Analysis) else [FAMILIES]
    texts += [FAMILY.format(name) for name in "GP" if summary["families"][name] is not None]
    if contact is not None and summary["contact"]["alignment"] == "balanced":
        cut = NOT_CERTIFIED if summary["hills"]["cut_certified"] is False else ""
        texts.append(LEVEL.replace("{0}", cut))
    if contact is not None:
        without = WITHOUT_BULK if contact.approach_without_bulk_m is not None else ""
        texts.append(CONTACT.format(contact.rung.contact_name) + without)
    if slip is not None:
        rigid = math.isinf(slip.tangential_stiffness_N_per_m)
        texts.append(SLIP.format("inf MN/m" if rigid else STIFFNESS))
    if damping is not None:
        defined = DAMPING if summary["damping"]["peak_loss_factor"] is not None else NOT_DEFINED
        if summary["damping"]["first_peak_loss_factor"] is not None:
            defined += FIRST_PEAK
        texts.append(NO_LOSS if damping.amplitude_at_peak_m is None else defined)
    if isinstance(analysis, Analysis):
        seen = analysis.conditioned
        lines.append(f"scan       {sanity_line(seen.surface, seen.sq_m, seen.sz_m)}")
    lines += [write_text(text, summary, absent="-") for text in texts]
    lines.append(f"status     {summary['status']}")
    lines += [f"  {p.severity:8} {p.code}: {p.message}" for p in analysis.problems]
    return "\n".join(printable(line) for line in lines)
