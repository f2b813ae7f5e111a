"""All figures of an analysis, by name, and how they are written."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from capslip.output import figures_band, figures_contact, figures_sensitivity, figures_surface

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from capslip.result import Analysis


@dataclass(frozen=True)
class Entry:
    """One figure of the report."""

    draw: "Callable[[Analysis], Figure | None]"  # None where the analysis lacks what it needs
    title: str
    needs: str  # what must exist for the figure to be drawn
    caption: str


FIGURES = {
    "height_map": Entry(
        figures_surface.height_map,
        "Height map",
        "a height map",
        "Heights after removal of the form, at equal scale in x and y. The line is the cut: the "
        "given share of the measured points lies above it. Grey: non-measured points. Pointed "
        "ends of the colour bar: lone spikes or pits lie beyond it.",
    ),
    "hills_and_caps": Entry(
        figures_surface.hills_and_caps,
        "Hills and caps",
        "a height map",
        "Hills above the cut in pale colours; the circle is the base of the fitted cap, with the "
        "equal-area diameter D of Eq. 18. Numbers are the rows of caps.csv, counted from 1 (left "
        "out where there are more than 60). Orange: G-caps; blue: P-caps; grey: no family.",
    ),
    "cap_profile": Entry(
        figures_surface.cap_profile,
        "Profile of a cap",
        "a cap",
        "One row of the map through the apex of a cap, with the fitted sphere and the two lengths "
        "that Eq. 18 takes: D, the diameter of the circle with the area of the hill at the cut, "
        "and df, the apex above the cut. Heights are enlarged by the factor printed; at true "
        "scale the cap would look flat.",
    ),
    "families": Entry(
        figures_surface.family_scatter,
        "Families of caps",
        "a cap",
        "Peak height and radius of every cap. Dashed: mean peak height of each family; h is the "
        "difference of the two means. Dotted: the cut.",
    ),
    "normal_curve": Entry(
        figures_contact.normal_curve,
        "Normal curve",
        "caps that carry the preload",
        "Load of one joint over its normal approach from first touch; the point is the preload. "
        "The bulk term is the sinking of the half-space as a whole. Where the model has one, the "
        "dotted line shows the same caps without their elastic interaction.",
    ),
    "slip_loop": Entry(
        figures_contact.slip_loop,
        "Slip loop",
        "caps that carry the preload and give way (any model but flat)",
        "Tangential force over tangential displacement at constant preload: first loading (dashed) "
        "and steady cycles up to three shares of the force at total slip. The area of a loop is "
        "the energy W lost per cycle. The bands are the phases of first loading; the "
        "first contact to slip as a whole ends GPS.",
    ),
    "energy": Entry(
        figures_contact.energy,
        "Energy lost per cycle",
        "caps that carry the preload and give way (any model but flat)",
        "Energy lost per cycle in one joint over the amplitude of the slip displacement. It grows "
        "with the third power where the amplitude is small.",
    ),
    "loss_factor": Entry(
        figures_contact.loss_factor,
        "Loss factor",
        "a slip curve and the structure's stiffnesses",
        "Loss factor of the mode from micro-slip in all joints, over the amplitude at mid-span. In "
        "the shaded range the joint slides as a whole and no steady cycle exists under a given "
        "force, so no value is given. The diamond is the answer, its bar the interval that holds "
        "90 % of what may be.",
    ),
    "contributions": Entry(
        figures_band.contributions,
        "What the intervals are made of",
        "an answer of which something is known to be uncertain, and no part beyond total slip",
        "First-order Sobol indices of the numbers of the answer: which input makes how much of "
        "their variance. Caps: heights and radii within their errors. Model: what else the "
        "contact model may be off by. Friction, preload and modulus: the spreads that were given. "
        "The form of the model is no input: dissipation of real joints is known to a factor of "
        "two to three at best.",
    ),
    "sensitivity": Entry(
        figures_sensitivity.sensitivity,
        "Sensitivity",
        "a usable cap",
        "Every answer with one choice changed at a time: the cut, the pruning of the hills, the "
        "S-filter and the levelling. W is the energy lost per cycle at half the force at total "
        "slip. In the shaded range the answer stays within its error bar: two standard errors, or "
        "the requested tolerance.",
    ),
}


def write_figure(name: str, analysis: "Analysis", folder: str | Path) -> Path | None:
    """Draw one figure of `FIGURES` as PNG; None where the analysis lacks what it needs."""
    figure = FIGURES[name].draw(analysis)
    if figure is None:
        return None
    path = Path(folder) / f"{name}.png"
    figure.savefig(path)
    return path
