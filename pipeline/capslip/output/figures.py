"""All figures of an analysis, by name, and how they are written."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from capslip.output import (
    figures_band,
    figures_contact,
    figures_sensitivity,
    figures_surface,
    figures_texture,
)
from capslip.output.canvas import save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from capslip.result import Analysis


@dataclass(frozen=True)
class Entry:
    """One figure of the report."""

    draw: "Callable[..., Figure | None]"  # None where the analysis lacks what it needs
    title: str
    needs: str  # what must exist for the figure to be drawn
    caption: str
    good: str  # what it looks like where all is well
    alt: str  # what it says, with the values of `output/rows.py`


FIGURES = {
    "height_map": Entry(
        figures_surface.height_map,
        "Height map",
        "a height map",
        "Heights after removal of the form, at equal scale in x and y. The line is the cut: the "
        "given share of the measured points lies above it. Grey: non-measured points. Pointed "
        "ends of the colour bar: lone spikes or pits lie beyond it. Circles: what touches under "
        "the preload, their areas as their loads.",
        "Good: no tilt, no bow, no stripes; grey points scattered rather than in patches; contacts "
        "spread over the face, on hills that the part has too.",
        "Map of the heights: Sq {sq_m}, Sz {sz_m}, {non_measured} non-measured, cut at "
        "{cut_height_m}.",
    ),
    "texture": Entry(
        figures_texture.texture,
        "Texture",
        "a height map",
        "Left: areal material ratio curve of the map that is cut, with the cut. Right: one-sided "
        "power spectral density of its rows and columns; its integral over the frequency is their "
        "mean square height. Shaded: waves that the map does not carry, as they are longer than "
        "the face, shorter than two pixels, filtered off, or weaker than the noise of the map. "
        "Dotted: white noise by which neighbouring points would differ as those of the map do, "
        "roughness of a few pixels included; `detail_decides` names what may be noise.",
        "Good: the cut left of the steep rise of the pits, and contacts between the shaded bands.",
        "Abbott curve with the cut at {cut_height_m}, and spectra: Sq {sq_m}, Ssk {Ssk}, waves "
        "carried from {shortest_wave_m} on.",
    ),
    "hills_and_caps": Entry(
        figures_surface.hills_and_caps,
        "Hills and caps",
        "a height map",
        "Hills above the cut in pale colours; the circle is the base of the fitted cap, with the "
        "equal-area diameter D of Eq. 18. Numbers are the rows of caps.csv, counted from 1 (left "
        "out where they would hide each other). Orange: G-caps, or the one family; blue: P-caps; "
        "grey: no family. A circle has the family of the hill that it stands on; m and n count "
        "the caps on the families' own plane, which may be more or fewer.",
        "Good: one circle a hill, about as large as it; no hill without one, none across two.",
        "Map of {hills} hills with the base circles of {caps} caps; on the families' own plane "
        "m {m}, n {n}.",
    ),
    "cap_profile": Entry(
        figures_surface.cap_profile,
        "Profile of a cap",
        "a cap",
        "One row of the map through the apex of the most loaded cap, where the map was pressed of "
        "that whose hill bears most, with the fitted sphere and "
        "the two lengths that Eq. 18 takes: D, the diameter of the circle with the area of the "
        "hill at the cut, and df, the apex above the cut. Heights are enlarged by the factor "
        "printed; at true "
        "scale the cap would look flat. The sphere is solid over D, and dashed beyond.",
        "Good: the points lie on the sphere down to the cut, or at least where they are pressed.",
        "Section through the most loaded cap, or the highest, with its fitted sphere.",
    ),
    "families": Entry(
        figures_surface.family_scatter,
        "Families of caps",
        "a cap",
        "Peak height and radius of every cap. Dashed: mean peak height of each family; h is the "
        "difference of the two means, on the plane on which the families are counted; m and n "
        "count the caps there, which may be more or fewer than here. Dotted: the cut.",
        "Good: clouds apart from each other in height, narrower than the gap h between them; "
        "or one.",
        "Peak height over radius of {caps} caps: h = {h_m}, mean R {radius_G_m:4} and "
        "{radius_P_m:4}.",
    ),
    "normal_curve": Entry(
        figures_contact.normal_curve,
        "Normal curve",
        "caps that carry the preload",
        "Load of one joint, or of the scan where that is a part of it, over the normal approach "
        "from first touch, or, of a face that yielded, over what that recovers on unloading; the "
        "point is the preload. "
        "The bulk term is the sinking of the half-space as a whole. Where the model has one, the "
        "dotted line shows the caps without their elastic interaction.",
        "Good: bent upwards, as more caps touch. A structural model of the parts holds the "
        "bulk sinking itself, so slip uses the curve without it, which is stiffer: it is what "
        "the contacts alone yield.",
        "Load over elastic approach up to {scan_load_N:4}: {approach_without_bulk_m} without bulk, "
        "{approach_m} with it; stiffness {stiffness_N_per_m}.",
    ),
    "slip_loop": Entry(
        figures_contact.slip_loop,
        "Slip loop",
        "caps that carry the preload and give way (any model but flat)",
        "Tangential force over tangential displacement at constant preload: first loading (dashed) "
        "and steady cycles up to three shares of the force at gross slip. The area of a loop is "
        "the energy W lost per cycle. The bands are the phases of first loading; the "
        "first contact to slip as a whole ends GPS.",
        "Good: slim loops that widen towards gross slip.",
        "Loops of force over displacement up to gross slip at {total_slip_force_N:4}, "
        "{total_slip_displacement_m}.",
    ),
    "energy": Entry(
        figures_contact.energy,
        "Energy lost per cycle",
        "caps that carry the preload and give way (any model but flat)",
        "Energy lost per cycle in one joint over the amplitude of the slip displacement. It grows "
        "with the third power where the amplitude is small. Pale: less slips than the pixels of "
        "the map resolve; single pixels make steps there. The diamond is the answer, its bar the "
        "interval that holds 90 % of what may be.",
        "Good: slope 3, then a bend towards slope 1 at gross slip; your amplitude right of what is "
        "pale.",
        "Energy over displacement: {answer_energy_J} at {answer_displacement_m}; gross slip "
        "at {total_slip_displacement_m}.",
    ),
    "loss_factor": Entry(
        figures_contact.loss_factor,
        "Loss factor",
        "a slip curve and the structure's stiffnesses",
        "Loss factor of the mode from micro-slip in all joints, over the amplitude at mid-span. In "
        "the shaded range the joint slides as a whole and no steady cycle exists under a given "
        "force, so no value is given; above 0.3 the mode is no longer lightly damped, the loss "
        "factor is not defined, and none is drawn. The diamond is the answer, its bar the interval "
        "that holds 90 % of what may be.",
        "Good: a rise with slope 1, and the amplitudes of the structure left of gross slip.",
        "Loss factor over amplitude: at most {peak_loss_factor} at {amplitude_at_peak_m}, "
        "gross slip from {gross_slip_amplitude_m}.",
    ),
    "contributions": Entry(
        figures_band.contributions,
        "What the intervals are made of",
        "an answer of which something is known to be uncertain, and no part beyond gross slip",
        "First-order Sobol indices of the numbers of the answer: which input makes how much of "
        "their variance. Caps: heights and radii within their errors. Model: what else the "
        "contact model may be off by. Friction, preload and modulus: the spreads that were given. "
        "Direction: of slip, where a lay makes it count and none was given. Scans: their scatter. "
        "The form of the model is no input: dissipation of real joints is known to a factor of "
        "two to three at best.",
        "Good: the longest bars of an input that can be measured. One colour: all of it is of one.",
        "Shares of the inputs in the variance of stiffness, energy and loss factor.",
    ),
    "sensitivity": Entry(
        figures_sensitivity.sensitivity,
        "Sensitivity",
        "a usable cap",
        "Every answer with one choice changed at a time: the cut, the pruning of the hills, the "
        "S-filter and the levelling. The approach is that with bulk; of a face that yielded, what "
        "it recovers on unloading. W is the energy lost per cycle at half the force at total "
        "slip. In the shaded range the answer stays within its error bar: two standard errors, or "
        "the requested tolerance.",
        "Good: every line flat inside its band.",
        "Answers over the choices of cut, pruning, filter and levelling.",
    ),
}
OF_JOINT = ("slip_loop", "energy", "loss_factor", "contributions")  # they need no single face


def write_figure(name: str, analysis: "Analysis", folder: str | Path) -> Path | None:
    """Draw one figure of `FIGURES` as PNG; None where the analysis lacks what it needs."""
    figure = FIGURES[name].draw(analysis)
    if figure is None:
        return None
    path = Path(folder) / f"{name}.png"
    save(figure, path)
    return path
