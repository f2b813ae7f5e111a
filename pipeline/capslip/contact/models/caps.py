"""Caps that each stand alone."""

from numpy.typing import ArrayLike

from capslip.contact.rung import Rung, Scene, contacts_of_caps, touching_caps
from capslip.contact.solvers.hertz import HertzCurve, checked_asperities


def caps(radius_m: ArrayLike, depth_m: ArrayLike, E_star_Pa: float) -> HertzCurve:
    """Return the normal curve of caps that each have their own radius and depth.

    As `families.families` with one cap each, in the order given.

    Examples
    --------
    >>> curve = caps([23.8] * 5 + [26.7] * 18, [0] * 5 + [2.4e-7] * 18, 109.89e9)
    >>> round(float(curve.load_N(2.5e-7)), 1)
    460.4
    """
    count, radius_m, depth_m = checked_asperities(1.0, radius_m, depth_m, E_star_Pa)
    return HertzCurve("caps", count, radius_m, depth_m, E_star_Pa)


def _build(scene: Scene) -> HertzCurve:
    return caps(scene.radius_m, scene.depth_m, scene.E_star_Pa)


RUNG = Rung(
    name="caps",
    label="caps",
    cost=2,
    made_from="spheres",
    automatic=True,
    holds_bulk=False,
    leaves_out="Each cap stands alone: the elastic interaction of the caps is left out, which "
    "makes the joint too stiff and lets too many caps touch.",
    colour="#CC79A7",
    build=_build,
    contacts=contacts_of_caps,
    touching=touching_caps,
)
