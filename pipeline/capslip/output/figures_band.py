"""Figure of the band: which input makes how much of what the answer leaves open."""

from typing import TYPE_CHECKING

from capslip.output.canvas import INK, blank

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from capslip.result import Analysis

NUMBERS = {  # of the answer, by name
    "tangential_stiffness_N_per_m": "stiffness",
    "energy_J": "energy",
    "joint_loss_factor": "loss factor, joint",
    "loss_factor": "loss factor, structure",
}
COLOURS = {  # after Okabe and Ito, but for the last
    "caps": "#D55E00",
    "model": "#0072B2",
    "plastic_law": "#A65628",
    "friction": "#009E73",
    "preload": "#E69F00",
    "modulus": "#56B4E9",
    "hardness": "#CC79A7",
    "scans": "#F0E442",
    "direction": "#000000",
    "part_of_joint": "#7F3C8D",
}
INTERACTIONS = "#BDBDBD"
LEAST_SHARE = 0.05  # %, of what can be seen


def contributions(analysis: "Analysis") -> "Figure | None":
    """One bar a number of the answer, cut into the shares of the inputs."""
    band = analysis.band
    found = {name: band.contributions.get(name) for name in NUMBERS} if band else {}
    shares = {name: one for name, one in found.items() if one}
    if not shares:
        return None
    figure, axes = blank("What the intervals are made of", height=1.4 + 0.6 * len(shares))
    inputs = list(next(iter(shares.values())))
    place, left = range(len(shares)), [0.0] * len(shares)
    for name in (*inputs, "interactions, steps"):
        width = [100.0 * one.get(name, 1.0 - sum(one.values())) for one in shares.values()]
        if max(width) < LEAST_SHARE:
            continue
        colour = COLOURS.get(name, INTERACTIONS)
        axes.barh(place, width, left=left, color=colour, height=0.6, label=name.replace("_", " "))
        left = [a + b for a, b in zip(left, width, strict=True)]
    axes.set_yticks(list(place), [NUMBERS[name] for name in shares], color=INK)
    axes.invert_yaxis()
    axes.set(xlim=(0.0, 100.0), xlabel="share of the variance of its logarithm [%]")
    axes.grid(axis="y", visible=False)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=9, frameon=False)
    return figure
