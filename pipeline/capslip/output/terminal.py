"""The results as one reads them on a terminal."""

import math
import textwrap
from pathlib import Path
from typing import Any

from capslip.errors import printable
from capslip.output.lead import (
    OF_FACES,
    answer_lines,
    assumed_lines,
    joint_line,
    mating_of,
    on_own_plane,
)
from capslip.output.quantity import engineering
from capslip.output.rows import UNEVEN, Value, write_text
from capslip.result import Analysis, JointOfScans, JointResult
from capslip.summary import summary_of
from capslip.surface.average import Average
from capslip.surface.doubts import points_line, sanity_line
from capslip.units import percent

SAME = 0.995  # of a noise, as it is written
HILLS = (
    "hills      cut {cut_height_m}, {regions} regions, {hills} hills, {caps} caps, largest "
    "region {largest_region_share:.0f %}"
)
FAMILIES = "families   m {m}, n {n}, h {h_m}"
OWN_PLANE = ", counted on their own plane"  # where the pressed one has another number of caps
ONE_FAMILY = "families   one, of {m} caps on its own plane"  # neither the higher nor the lower
FAMILY = "  {1:9}R {{radius_{0}_m:4}}"
OF_HILLS = ", D {{diameter_{0}_m}}, df {{height_{0}_m}}"  # which families that are given have not
LEVEL = "level      turned by {tilt_across_face_m} across the face until balanced{0}"
NOT_CERTIFIED = "; the cut does not hold all that touches"
CONTACT = "contact    {{model}}: {{scan_load_N:4}} on {{contacts}} {0}, {1}"
APPROACH = "{approach_without_bulk_m} ({approach_m} with bulk)"  # the first, as in the report
SLIP = (
    "slip       stiffness {0}, gross slip at {{total_slip_force_N:4}}, "
    "{{total_slip_displacement_m}}"
)
STIFFNESS = "{tangential_stiffness_N_per_m}"  # null in the summary where it is infinite
NO_LOSS = "damping    {structure}: no loss below gross slip at {gross_slip_amplitude_m}"
NOT_DEFINED = (
    "damping    {structure}: no longer lightly damped at its peak, gross slip at "
    "{gross_slip_amplitude_m}"
)
DAMPING = (
    "damping    {structure}: peak loss factor {peak_loss_factor:.4g} at {amplitude_at_peak_m}, "
    "gross slip at {gross_slip_amplitude_m}"
)
FIRST_PEAK = "; first maximum {first_peak_loss_factor:.4g} at {amplitude_at_first_peak_m}"


def result_lines(analysis: JointResult) -> str:
    """Return the results as one screen: the verdict, the answer, what was assumed, the rest."""
    summary = summary_of(analysis, texture=False)
    lead = [("verdict", summary["verdict"]), *answer_lines(summary, "-")]
    lead.append(("joint", joint_line(summary, "-")))
    assumed = [f"{name} {value}: moves {moves}" for name, value, moves in assumed_lines(summary)]
    lead += zip(["assumed", *[""] * len(assumed)], assumed, strict=False)
    lines = [f"{label:10} {text}" for label, text in lead]
    contact, slip, damping = analysis.contact, analysis.slip, analysis.damping
    of = summary["families"]
    one = of["G"] is not None and of["P"] is None
    of_scan = isinstance(analysis, Analysis)
    families = FAMILIES + (OWN_PLANE if on_own_plane(summary) else "")
    texts = [*([HILLS] if of_scan else []), ONE_FAMILY if one else families]
    if isinstance(analysis, JointOfScans):
        texts, lines = [], [*lines, *_lines_of_scans(summary["scans"])]
    family = FAMILY + OF_HILLS if of_scan else FAMILY
    texts += [family.format(name, "" if one else name) for name in "GP" if of[name] is not None]
    if contact is not None and summary["contact"]["alignment"] == "balanced":
        cut = NOT_CERTIFIED if summary["hills"]["cut_certified"] is False else ""
        texts.append(LEVEL.replace("{0}", cut))
    if contact is not None:
        whole = CONTACT.format(contact.rung.contact_name, _approach(summary, of_scan))
        texts.append(whole if analysis.joint.is_even else whole + UNEVEN)
    if slip is not None:
        rigid = math.isinf(slip.tangential_stiffness_N_per_m)
        texts.append(SLIP.format("infinite" if rigid else STIFFNESS))
    if damping is not None:
        defined = DAMPING if summary["damping"]["peak_loss_factor"] is not None else NOT_DEFINED
        if summary["damping"]["first_peak_loss_factor"] is not None:
            defined += FIRST_PEAK
        texts.append(NO_LOSS if damping.amplitude_at_peak_m is None else defined)
    if isinstance(analysis, Analysis):
        seen, read = analysis.conditioned, points_line(analysis.surface)
        analysed = sanity_line(seen.surface, seen.sq_m, seen.sz_m)
        if (mating := mating_of(seen.steps)) is not None:
            both = ", ".join(engineering(one_m, "m") for one_m in mating["sq_of_faces_m"])
            analysed += f", {OF_FACES[mating['way']]}: with its mate {mating['second']}, Sq of each"
            analysed += f" {both}"
        if read == points_line(seen.surface):
            lines.append(f"scan       {analysed}")
        else:
            lines += [f"scan       as read: {read}", f"{'':10} as analysed: {analysed}"]
    lines += [write_text(text, summary, absent="-") for text in texts]
    lines.append(f"status     {summary['status']}")
    on_page = isinstance(analysis, Analysis | JointOfScans)  # of given families there is no report
    serious = [one for one in analysis.problems if one.severity != "info" or not on_page]
    lines += [f"  {p.severity:8} {p.code}: {p.text}" for p in serious]
    said = {p.code for p in serious}
    if codes := dict.fromkeys(p.code for p in analysis.problems if p.code not in said):
        lines.append(f"  info     {', '.join(codes)}: see the report")
    return "\n".join(printable(line) for line in lines).replace("µ", "u")


def _approach(summary: dict[str, Any], of_scan: bool) -> str:
    """Return how far the faces came together and, where they yielded, what of it is elastic."""
    contact = summary["contact"]
    without = of_scan and contact["approach_without_bulk_m"] is not None
    approach = APPROACH if without else "{approach_m}"
    if contact["first_loading_approach_m"] == contact["approach_m"]:
        return f"approach {approach}"
    recovers = f"recovers {approach} on unloading"
    if contact["first_loading_approach_m"] is None:
        return recovers
    first = approach.replace("{approach", "{first_loading_approach")
    return f"approach on first loading {first}, {recovers}"


def wrapped(text: str, width: int) -> str:
    """Break lines at the width of a terminal; what follows stands under the text of its line.

    Examples
    --------
    >>> print(wrapped("verdict    usable with care: the last turn still moved", 34))
    verdict    usable with care: the
               last turn still moved
    """
    indent = " " * 11
    lines = [
        textwrap.wrap(
            line,
            max(width, 30),
            subsequent_indent=indent,
            break_long_words=False,
            break_on_hyphens=False,
        )
        for line in text.split("\n")
    ]
    return "\n".join("\n".join(parts) for parts in lines)


def _lines_of_scans(scans: list[dict[str, Any]]) -> list[str]:
    """Return a line for each scan: its share, and the answer of a joint of its face alone."""
    lines = []
    for label, scan in zip(["scans", *[""] * len(scans)], scans, strict=False):
        answer = scan["answer"]
        if scan["share"] is None or answer["energy_J"] is None:
            text = "no answer: see the problems"
        else:
            share = percent(scan["share"])
            stiffness = Value(answer["tangential_stiffness_N_per_m"], "N/m", "-")
            text = (
                f"{share} of the joint, {scan['contacts']} contacts, {scan['model']}; "
                f"alone {stiffness:3} (secant), {Value(answer['energy_J'], 'J'):3} lost per cycle"
            )
        lines.append(f"{label:10} {scan['name']}: {text}")
    return lines


def average_lines(found: Average, names: list[str], path: Path) -> str:
    """Return what several scans of one place said, as lines."""
    surface, n = found.surface, found.scans_a_point
    noise = f"{engineering(found.noise_m, 'm')} (rms) a height of one scan, where it is highest"
    if found.white_m is not None:
        noise += f"; {engineering(found.white_m, 'm')} from pixel to pixel"
    of_mean = f"{engineering(surface.noise_m, 'm')}, over the root of {n:.3g}"
    if surface.noise_m is not None and surface.noise_m * math.sqrt(n) < SAME * found.noise_m:
        of_mean += ", less what splines took where scans lie a fraction of a pixel aside"
    if found.fewer:
        points = f"{found.fewer} of {surface.n_measured} points"
        of_mean += f"; {points} are in fewer than {len(names)} scans"
    lines = [
        ("noise", noise),
        ("", f"{engineering(found.everywhere_m, 'm')} over the whole map"),
        ("of mean", of_mean),
    ]
    for name, (dy, dx) in list(zip(names, found.moved_pixels, strict=True))[1:]:
        along_y, along_x = (round(one, 2) + 0.0 for one in (dy, dx))  # no -0.00
        moved = f"{along_y:.2f} pixels along y, {along_x:.2f} along x"
        lines.append(("moved", f"{printable(name)} by {moved}"))
    if found.spikes:
        lines.append(("left out", f"{found.spikes} heights that only one scan has"))
    if found.bow_m > found.noise_m:
        bow = f"forms differ by {engineering(found.bow_m, 'm')} (rms) from scan to scan"
        left = f"{engineering(surface.form_error_m, 'm')} high (standard error)"
        lines.append(("bow", f"{bow}; of mean a bow {left}"))
    lines.append(("written", str(path)))
    return "\n".join(f"{label:10} {text}" for label, text in lines)
