"""The cheapest contact model whose estimated error a scene allows."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from capslip.caps.families import Families
from capslip.caps.table import CapTable
from capslip.contact.accuracy import CapsError, MovedCaps, answers, error_of_caps
from capslip.contact.bulk import bulk_of_face_m_per_N
from capslip.contact.curve import NormalCurve
from capslip.contact.flattening import flattened
from capslip.contact.map_doubts import ASKED
from capslip.contact.material import composite, yield_law
from capslip.contact.models.interacting import RUNG as REFERENCE
from capslip.contact.models.mean_field import RUNG as FALLBACK
from capslip.contact.reach import reachable
from capslip.contact.rung import ModelError, Rung, Scene, ladder, rung
from capslip.contact.time_needed import TIME_LIMIT, boundary_elements_s, more_time
from capslip.errors import BothFailError, ContactError, cause
from capslip.problems import Effect, Problem, Severity
from capslip.settings import Settings
from capslip.surface.heightmap import HeightMap
from capslip.units import percent

# By how much more a rung below interacting caps must be within the tolerance: its difference to
# them is taken at five numbers alone, and to interact costs next to nothing
MARGIN = 0.0085
ONE_MAP = "--set mating.way=composite, which makes one map of two faces"
WHY = "see why boundary elements fail: preload, units, pixels or contact.time_limit_s"


@dataclass(frozen=True, eq=False)
class Choice:
    """The contact model for one face and load, made by `choose_model`."""

    model: str
    reason: str
    estimated_error: float | None  # of energy and stiffness, at 95 %; None: not known
    estimates: dict[str, float | None]  # of every rung that was tried
    use: np.ndarray  # (n,), the caps that can touch
    boundary_elements_s: float | None  # what they would take, where there is no time for them
    levelling: bool = False  # whether the levelling alone makes it doubtful
    of_noise: Severity | None = None  # how doubtful the noise of the map alone makes it
    why: str = ""  # what is wrong with the caps
    of_the_map: bool = False  # whether the map itself is pressed for that
    moved: MovedCaps | None = None  # where the error of the caps is known
    step: str | None = None  # what to do next, where boundary elements have no map
    caps: "Choice | None" = None  # that among the caps, where the map is pressed instead
    errors: ModelError | None = None  # of caps that are beyond the tolerance, by the force

    @property
    def model_errors(self) -> ModelError | None:
        """By the force where noise makes them, else one for all; None: not known."""
        return self.errors if self.of_noise else ModelError.of_either(self.estimated_error)

    @property
    def errors_by_force(self) -> ModelError | None:
        """By the force where that is known, else one for all; None: not known."""
        return self.errors or ModelError.of_either(self.estimated_error)

    def caps_within(self, error: float) -> "Choice | None":
        """Return the choice among the caps where its error is known and smaller than one.

        Both from a quarter of mu N on: below, a map knows little of what lets go of its pixels.
        """
        known = None if self.caps is None else self.caps.errors_by_force
        return self.caps if known is not None and known.greatest_at(ASKED) < error else None

    @property
    def problem(self) -> Problem | None:
        """What makes a result of this choice doubtful."""
        if self.of_the_map:
            return caps_not_pressed(self.why)
        effect = _effect(self.estimated_error)
        if self.levelling:
            return Problem("levelling_decides", "warning", self.reason, effect)
        if self.of_noise is not None:
            return Problem("noise_decides", self.of_noise, self.reason, effect)
        if self.boundary_elements_s is None:
            return None
        return Problem("boundary_elements_needed", "warning", self.reason, effect, self.step)


def choose_model(
    caps: CapTable,
    families: Families,
    surface: HeightMap,
    label: np.ndarray | None,
    noise_m: float,
    settings: Settings,
    map_failure: str = "",
) -> Choice:
    """Choose the cheapest rung whose estimated error is within the tolerance.

    The error of a rung is the greatest relative one of the energy of a cycle at four forces and of
    the stiffness. For a lower rung it is the difference to interacting caps plus their own error,
    see `error_of_caps`. Its approach, less the bulk sinking, may differ from theirs by as much as
    the tolerance, too: equal spheres under a light load share it equally, where the highest hill,
    from which the approach counts, carries more.

    Parameters
    ----------
    caps : CapTable
        Caps of the face, at least one of them usable.
    families : Families
        Their families.
    surface : HeightMap
        Heights after removal of the form, to see whether anything else touches.
    label : int, shape (ny, nx)
        The hills of the caps; 0 elsewhere. None where the caps are not those of one map: then
        nobody looks for what else touches.
    noise_m : float
        Standard deviation of the noise of the map.
    settings : Settings
        `material`, and `contact` with its tolerance.
    map_failure : str
        Why the map itself cannot be pressed, where that is known: then it is not chosen.

    Returns
    -------
    Choice
        Where no rung with caps is within the tolerance, or the caps cannot carry the preload:
        boundary elements, if they are expected to end within `contact.time_limit_s`; else the
        highest rung with caps, with the time that they would take. Where the levelling alone is
        the cause, which they share, or noise, which the map has as well, caps too. Where the map is
        chosen, `caps` keeps what was best among these: its detail may turn out to decide more than
        they are off.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload, and there is no time for boundary elements.
    """
    one = None if label is None or map_failure else rung_of_the_map(surface, settings)
    try:
        choice = _among_caps(caps, families, surface, label, noise_m, settings)
    except ContactError as failure:
        if one is None:
            raise
        return _of_the_map(one, str(failure), {}, len(caps))
    if choice.boundary_elements_s is None:
        return choice
    if label is None:
        return replace(choice, step=ONE_MAP)
    if one is None:
        why = f", but fail: {map_failure}" if map_failure else _more_than(settings)
        step = step_of_time(choice.reason + why, surface, settings) or WHY
        return replace(choice, reason=choice.reason + why, step=step)
    chosen = _of_the_map(one, choice.why, choice.estimates, len(caps))
    return replace(chosen, caps=choice)


def caps_not_pressed(why: str) -> Problem:
    """Return the note that the map was pressed in place of its caps."""
    message = (
        f"{why}: m, n, R and h describe the caps as counted, and are neither the face nor what was "
        "pressed"
    )
    return Problem("caps_not_pressed", "info", message)


def rung_of_the_map(surface: HeightMap, settings: Settings) -> Rung | None:
    """Return the rung that presses the map itself, None where there is no time for it."""
    if boundary_elements_s(surface.shape) > settings.contact.time_limit_s:
        return None
    (one,) = (one for one in ladder() if one.made_from == "map")
    return one


def contact_failed(failure: ContactError, surface: HeightMap | None, settings: Settings) -> Problem:
    """Return the problem of a face that cannot be pressed; with time enough where that is why.

    Parameters
    ----------
    failure : ContactError
        What was raised.
    surface : HeightMap or None
        The map that may be pressed; None where there are two, whose caps are counted.
    settings : Settings
        With which it was tried.
    """
    message, step = str(failure), None
    if isinstance(failure, BothFailError) and surface is not None:
        of_caps, of_map = failure.of_caps, failure.of_map
        message = f"{_caps_fail(of_caps)}; the map, pressed in their place, fails as well, as "
        message += cause(_without_name(of_map, surface.origin.name))
        step = step_of_time(message, surface, settings) or _step_of_map(of_map)
    elif surface is not None:
        no_time = settings.contact.model == "auto" and rung_of_the_map(surface, settings) is None
        if no_time and TIME_LIMIT not in message:
            needed_s = boundary_elements_s(surface.shape)
            message = f"{_caps_fail(message)}; the map was not pressed, as boundary elements take "
            message += f"about {needed_s:.2g} s{_more_than(settings)}"
        step = step_of_time(message, surface, settings)
        if no_time:  # caps that cannot carry it may be right
            step = f"{step}; or check the load, --area and units"
    return Problem("contact_failed", "error", message, step=step)


def _caps_fail(message: str) -> str:
    """Say once, of which model, why caps fail."""
    name = message.partition(": ")[0]
    of, known = "the caps", {one.name for one in ladder()}
    which = f" ({name})" if name in known and not of.endswith(name) else ""
    return f"{of}{which} fail, as {cause(_without_name(message))}"


def _without_name(message: str, of_map: str = "") -> str:
    """Return a message without the name of the model or the map, which the reader knows."""
    name, _, rest = message.partition(": ")
    return rest if name in {of_map, *(one.name for one in ladder())} else message


def _step_of_map(failure: str) -> str | None:
    """Return what to do about a map that fails where caps do as well; None: check the load."""
    *_, advice = failure.split("; ")
    if advice == failure or advice.startswith(("expected", "check")) or "of caps" in advice:
        return None
    return f"{advice[0].upper()}{advice[1:]}; or check the load, --area and units."


def step_of_time(message: str, surface: HeightMap, settings: Settings) -> str | None:
    """Return the step to time enough, where a message of a failure names the limit; else None."""
    if TIME_LIMIT not in message:
        return None
    return more_time(surface.shape, settings.contact.time_limit_s)


def _more_than(settings: Settings) -> str:
    return f", more than {settings.contact.time_limit_s:g} s of {TIME_LIMIT}"


def map_for_auto(surface: HeightMap, settings: Settings) -> Rung | None:
    """Return the rung that presses the map, where the automatic choice has time for it."""
    return rung_of_the_map(surface, settings) if settings.contact.model == "auto" else None


def _of_the_map(one: Rung, why: str, estimates: dict[str, float | None], n_caps: int) -> Choice:
    """Return the rung that presses the map itself, and why the caps are not enough."""
    use = np.zeros(n_caps, dtype=bool)
    reason = f"{why}; so the map itself is pressed"
    return Choice(one.name, reason, None, estimates, use, None, why=why, of_the_map=True)


def _among_caps(
    caps: CapTable,
    families: Families,
    surface: HeightMap,
    label: np.ndarray | None,
    noise_m: float,
    settings: Settings,
) -> Choice:
    """Choose among the rungs with caps; parameters and errors as for `choose_model`."""
    every = tuple(one for one in ladder() if one.automatic)
    given = (caps, families, surface, label, noise_m, settings)
    scene, own, estimates, of_approach = _compared(every, *given)
    if own is None:
        return _too_many(scene, settings)
    contact = settings.contact
    for model, estimate in estimates.items():
        margin = 0.0 if model == REFERENCE.name else MARGIN
        within = of_approach[model] <= contact.tolerance
        if within and estimate is not None and estimate + margin <= contact.tolerance:
            reason = (
                f"the cheapest model within {percent(contact.tolerance)}: its error is about "
                f"{percent(estimate)}"
            )
            chosen = (model, reason, estimate, estimates, scene.use, None)
            return Choice(*chosen, moved=own.moved)
    return _beyond_tolerance(own, estimates, scene, settings)


def _compared(
    rungs: Sequence[Rung],
    caps: CapTable,
    families: Families,
    surface: HeightMap,
    label: np.ndarray | None,
    noise_m: float,
    settings: Settings,
) -> tuple[Scene, CapsError | None, dict[str, float | None], dict[str, float]]:
    """Return the scene of the caps that can touch, their own error, and the estimates of rungs.

    And by how much the approach of each differs from that of interacting caps. No error where there
    are too many for every pair. Other parameters and errors as for `choose_model`.
    """
    if not caps.usable.any():
        raise ContactError("no cap stands above the cut")
    material, contact = settings.material, settings.contact
    E_star_Pa = composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa
    reach = reachable(caps, surface, E_star_Pa, contact.preload_N, yield_law(material))
    scene = Scene.of(caps, families, surface, settings, reach.use)
    if reach.pairs is None:
        return scene, None, {}, {}
    at = answers(reach.pairs, REFERENCE.holds_bulk, surface, settings)
    at_m = _approach_m(REFERENCE, reach.pairs, scene)
    own = error_of_caps(scene, reach.pairs, at, label, noise_m, settings)
    estimates: dict[str, float | None] = {}
    of_approach: dict[str, float] = {}
    for one in rungs:
        with suppress(ContactError):  # a rung that cannot carry the load is none
            numbers, approach_m = at, at_m
            if one is not REFERENCE:
                numbers, approach_m = _answers(one, scene, settings)
            difference = float(np.abs(numbers / at - 1.0).max())
            of_approach[one.name] = abs(approach_m - at_m) / abs(at_m)
            estimates[one.name] = None if own.total is None else difference + own.total
    return scene, own, estimates, of_approach


def estimate_error(
    caps: CapTable,
    families: Families,
    surface: HeightMap,
    label: np.ndarray | None,
    noise_m: float,
    settings: Settings,
) -> tuple[float | None, MovedCaps | None, tuple[Problem, ...]]:
    """Estimate the error of the model that the settings force; far longer work than to press it.

    Parameters
    ----------
    caps, families, surface, label, noise_m, settings
        As for `choose_model`; `contact.model` names a rung.

    Returns
    -------
    float or None, MovedCaps or None, tuple of Problem
        None where it is not known: for a rung that the choice does not compare, and where
        interacting caps, against which the others are measured, cannot carry the load. A problem
        where it is not known to be within the tolerance, unless nothing doubts the rung itself.
    """
    forced = rung(settings.contact.model)
    if not forced.automatic:
        doubt = forced.doubt
        doubts = () if doubt is None else (Problem("model_doubtful", "warning", doubt),)
        return None, None, doubts
    try:
        given = (caps, families, surface, label, noise_m, settings)
        scene, own, estimates, approaches = _compared((forced,), *given)
        if own is None:
            _answers(FALLBACK, scene, settings)  # raises where they cannot carry the load
        estimate, why = estimates.get(forced.name), ""
        of_approach = approaches.get(forced.name, 0.0)
        moved = None if own is None else own.moved
    except ContactError as failure:
        estimate, moved, of_approach, why = None, None, 0.0, f" ({failure})"
    tolerance = settings.contact.tolerance
    if estimate is not None and max(estimate, of_approach) <= tolerance:
        return estimate, moved, ()
    off = f"not known{why}"
    if estimate is not None:
        alone = f"{percent(of_approach)} in the approach" if estimate <= tolerance else ""
        off = f"about {alone or percent(estimate)}, more than {percent(tolerance)}"
    message = (
        f"the error of {forced.name} is {off}; contact.model = auto takes the cheapest model that "
        f"is within {percent(tolerance)}"
    )
    return estimate, moved, (Problem("model_doubtful", "warning", message, _effect(estimate)),)


def _effect(estimate: float | None) -> Effect | None:
    """Return what an estimated error moves: any of the answers, by at most that."""
    return None if estimate is None else Effect(estimate, estimate, estimate)


def _answers(one: Rung, scene: Scene, settings: Settings) -> tuple[np.ndarray, float]:
    """Return the `answers` of a rung, and its approach."""
    curve = one.build(flattened(one, scene))
    numbers = answers(curve, one.holds_bulk, scene.surface, settings)
    return numbers, _approach_m(one, curve, scene)


def _approach_m(one: Rung, curve: NormalCurve, scene: Scene) -> float:
    """Return the approach of a rung under the preload, less the bulk sinking that it holds."""
    bulk_m_per_N = bulk_of_face_m_per_N(scene.surface, scene.E_star_Pa) if one.holds_bulk else 0.0
    return float(curve.approach_m(scene.preload_N)) - bulk_m_per_N * scene.preload_N


def _beyond_tolerance(
    own: CapsError, estimates: dict[str, float | None], scene: Scene, settings: Settings
) -> Choice:
    """Return the reference, and why it is not enough."""
    tolerance = settings.contact.tolerance
    off = "" if own.total is None else f"{percent(own.total)}, more than {percent(tolerance)}"
    if own.total is not None and own.of_caps <= tolerance:
        reason = (
            f"interacting caps may be off by {off}: the plane "
            "of the lowest third of the points instead of what was taken off changes the answers "
            f"by {percent(own.of_levelling)}; where the caps lie tilts a least-squares plane, and "
            "conditioning.form_floor = true follows the floor between them, where there is one"
        )
        levelled = (REFERENCE.name, reason, own.total, estimates, scene.use, None)
        return Choice(*levelled, levelling=True, moved=own.moved)
    if own.errors is not None and own.of_noise > max(tolerance, own.without_noise):
        return _as_noise_allows(own, own.errors, estimates, scene, tolerance)
    needed_s = boundary_elements_s(scene.surface.shape)
    why = own.doubt or f"interacting caps may be off by {off}"
    reason = f"{why}; boundary elements are needed and take about {needed_s:.2g} s"
    given = (own.total, estimates, scene.use, needed_s)
    return Choice(REFERENCE.name, reason, *given, why=why, moved=own.moved, errors=own.errors)


def _as_noise_allows(
    own: CapsError,
    errors: ModelError,
    estimates: dict[str, float | None],
    scene: Scene,
    tolerance: float,
) -> Choice:
    """Return the reference where noise is the cause; a note where small forces alone feel it.

    As of the map, see `error_of_map`, and like that with errors that fall with the force.
    """
    asked = errors.greatest_at(ASKED)
    severity: Severity = "warning" if asked > tolerance else "info"
    reason = (
        f"the noise of the map leaves up to {percent(errors.greatest)} in what interacting caps "
        f"answer, {percent(asked)} from {percent(ASKED)} of gross slip on; a cap averages over the "
        "points of its hill, and the map itself over no more of them"
    )
    given = (REFERENCE.name, reason, own.total, estimates, scene.use, None)
    return Choice(*given, of_noise=severity, moved=own.moved, errors=errors)


def _too_many(scene: Scene, settings: Settings) -> Choice:
    """Return mean field, whose error nothing on the ladder tells."""
    _answers(FALLBACK, scene, settings)  # raises where they cannot carry the load
    why = f"{np.count_nonzero(scene.use)} caps that can touch are too many to solve for every pair"
    needed_s = boundary_elements_s(scene.surface.shape)
    reason = f"{why}; boundary elements are needed and take about {needed_s:.2g} s"
    known: dict[str, float | None] = {FALLBACK.name: None}
    return Choice(FALLBACK.name, reason, None, known, scene.use, needed_s, why=why)
