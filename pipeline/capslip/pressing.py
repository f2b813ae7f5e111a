"""A face under its share of the preload, and the joint under shear.

What a pressed face says of its own error is said here, too: of a joint that is pressed unevenly,
under the lightest load that counts.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from capslip.caps.families import Families
from capslip.caps.table import UNUSABLE, CapTable
from capslip.contact.balanced import levelled
from capslip.contact.choice import (
    Choice,
    caps_not_pressed,
    choose_model,
    estimate_error,
    map_for_auto,
)
from capslip.contact.curve import NormalCurve
from capslip.contact.direction import with_direction
from capslip.contact.joint import Joint, knowing_levels
from capslip.contact.levelling import turned
from capslip.contact.press import ContactState, press
from capslip.contact.rung import ModelError, asked_of_error, made_from, rung
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.contact.time_needed import boundary_elements_s
from capslip.contact.uneven_accuracy import (
    ASKED,
    error_against,
    error_of_joint,
    error_of_patches,
    lightest,
    out_of_time,
    problems_of_levels,
    problems_of_patches,
    stiffness_and_energies,
)
from capslip.contact.varying_load import greatest_over_mean, varying
from capslip.errors import BothFailError, ContactError
from capslip.problems import Problem
from capslip.settings import Settings
from capslip.stages import Clock, Face, levelled_anew
from capslip.surface.heightmap import HeightMap
from capslip.surface.noise import known_noise_m
from capslip.units import off_by

# Of the preload, where caps are sought anew to see whether they stay, by stiffness and energies
SOUGHT_AT, ASKED_OF_CAPS, SAME_CAPS = (0.01, 0.03, 0.1, 0.3, 0.6, 2.0), (0.1, 0.25, 0.5), 0.1
BETTER_SCAN = "average several scans (capslip average), or scan with more points on each hill"

WithDoubts = tuple[ContactState, tuple[Problem, ...]]


def press_face(
    face: Face, settings: Settings, clock: Clock
) -> tuple[ContactState, CapTable, SlipCurve]:
    """Press a face with its share of the preload, and shear the joint.

    Returns
    -------
    ContactState, CapTable, SlipCurve
        The state of the face under its share; the caps with their loads; the slip curve of the
        whole joint.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload within the validity of the model.
    """
    shape = face.conditioned.surface.shape
    needs_map = map_for_auto(face.conditioned.surface, settings) or made_from(settings) == "map"
    limit_s = settings.contact.time_limit_s
    with clock("contact", boundary_elements_s(shape) if needs_map else None, limit_s):
        contact, caps = _pressed(face, settings)
    with clock("slip"):
        contact, slip, dearer = _sheared(face, contact, caps, settings)
    if dearer is None:
        return contact, caps, slip
    try:
        with clock("contact"):
            other, other_caps = _pressed_as(dearer, face, settings)
        with clock("slip"):
            other, other_slip, _ = _sheared(face, other, other_caps, settings)
    except ContactError as failure:
        said = f"fails: {failure}"
    else:
        known, better = contact.errors, other.errors
        if better is None:
            said = "does not know how far it is off"
        elif known is None or known.greatest_at(ASKED) > better.greatest_at(ASKED):
            return other, other_caps, other_slip
        else:
            said = f"may be off by {off_by(better.greatest_at(ASKED))}"
    return replace(contact, problems=_tried(contact.problems, said)), caps, slip


def _tried(doubts: tuple[Problem, ...], found: str) -> tuple[Problem, ...]:
    """Return doubts of caps that stay in use with what was found of the map that they asked for."""
    return tuple(
        replace(
            one,
            message=f"{one.message}; the map was pressed as well, and {found}",
            step=BETTER_SCAN,
        )
        if one.code == "boundary_elements_needed"
        else one
        for one in doubts
    )


def _sheared(
    face: Face, contact: ContactState, caps: CapTable, settings: Settings
) -> tuple[ContactState, SlipCurve, Choice | None]:
    """Return the face with the errors of its joint, the slip of that, and a dearer model.

    One that the automatic choice takes where the joint is lighter.
    """
    joint, surface, tolerance = face.joint, face.conditioned.surface, settings.contact.tolerance
    contact = _with_levels(face, with_direction(contact, caps, surface, settings), settings)
    patches = joint.loaded(contact, greatest_over_mean(settings.slip))
    friction, kappa = settings.material.friction_coefficient, joint.kappa_of(patches)
    curve = joint.curve_of(patches, kappa)
    slip = varying(slip_curve(curve, joint.preload_N, friction, kappa), settings.slip)
    _ = slip.total_slip_displacement_m  # contacts that overlap may have none: told before any table
    contact = replace(contact, problems=(*contact.problems, *out_of_time(patches)))
    contact, dearer = _with_errors_of_joint(face, contact, curve, patches, settings)
    left = error_of_patches(joint, patches)
    doubts = problems_of_patches(joint, patches, left, tolerance)
    doubts += problems_of_levels(joint, contact, patches)
    found = replace(contact, patch_errors=left, problems=(*contact.problems, *doubts))
    return found, slip, dearer


def finding_caps_anew(face: Face, contact: ContactState, settings: Settings) -> ContactState:
    """Return a balanced face of caps that finds them anew under other pressures, as its level.

    Cut, fitted as deep as they are compressed there, and turned: as an analysis would find it. The
    same face where that moves less than a tenth.

    Raises
    ------
    ContactError
        If the face cannot carry one of the loads under which that is seen.
    """
    if contact.at_level is None or face.level is None or contact.rung.made_from != "spheres":
        return contact
    anew = _with_levels(face, contact, settings, fits=True)
    # Each takes as long as the level of the analysis: where the caps stay, they need not be sought
    same = all(_alike(contact, anew, factor * contact.preload_N) for factor in SOUGHT_AT)
    return contact if same else anew


def _alike(kept: ContactState, anew: ContactState, load_N: float) -> bool:
    """Tell whether two states answer alike under a load, in stiffness and energies."""
    curves = (one.of_patch(load_N).curve for one in (kept, anew))
    was, found = (stiffness_and_energies(one, load_N, ASKED_OF_CAPS) for one in curves)
    return bool(np.abs(found / was - 1.0).max() <= SAME_CAPS)


def _with_levels(
    face: Face, contact: ContactState, settings: Settings, fits: bool = False
) -> ContactState:
    """Return a pressed face that knows how it lies under other pressures, or all that touches."""
    if not finds_its_level(face, contact, settings):
        return contact

    def anew(load_N: float) -> ContactState:
        pressed, caps = _lying_anew(face, contact, load_N, settings, fits)
        if contact.kappa_along is None:
            return pressed
        return with_direction(pressed, caps, face.conditioned.surface, settings)

    return knowing_levels(contact, anew)


def _with_errors_of_joint(
    face: Face,
    contact: ContactState,
    curve: NormalCurve,
    patches: Sequence[ContactState],
    settings: Settings,
) -> tuple[ContactState, Choice | None]:
    """Return the face with the errors of its joint, and a model for where that is lighter."""
    light = lightest(face.joint, curve, [*patches[:-1], contact])
    if light is None:
        return contact, None
    lying = _lying(face, contact, light.preload_N, settings)
    dearer: Choice | None = None
    try:
        if settings.contact.model == "auto" and light.rung.error is None:
            light, doubts, dearer = _as_chosen(lying, light, settings)
        else:
            light, doubts = _with_error(lying, light, settings)
    except ContactError as failure:
        message = f"nobody knows how far stiffness and energy are off: {failure}"
        doubts = (Problem("pressures_interpolated", "warning", message),)
    given = face.joint, curve, contact, light, doubts, settings.contact.tolerance
    errors, problems, energy_share = error_of_joint(*given)
    if errors.greatest_at(ASKED) <= settings.contact.tolerance:
        dearer = None
    found = replace(contact, errors=errors, problems=problems, light=light)
    return replace(found, energy_share=energy_share), dearer


def _pressed(face: Face, settings: Settings) -> tuple[ContactState, CapTable]:
    """Press a face; where the map was chosen and fails, its caps stand in as well as they can."""
    found = as_found(face, settings)
    given = (face.caps, face.families, face.conditioned.surface)
    more = (face.label, face.hills.noise_m)
    level = face.level  # what holds the parts is at ease as they were levelled
    at_ease_rad = (0.0, 0.0) if level is None else (-level.slope[0], -level.slope[1])
    try:
        contact, caps = press(*given, found, *more, at_ease_rad=at_ease_rad)
        if found.contact.model != settings.contact.model:
            reason = "the caps find no level; so the map itself is pressed, which finds its own"
            contact, doubts = _with_error(face, replace(contact, model_reason=reason), settings)
            if face.caps.usable.any():
                doubts = (caps_not_pressed("the caps find no level"), *doubts)
            contact = replace(contact, problems=(*contact.problems, *doubts))
        return contact, caps
    except ContactError as failure:
        if settings.contact.model != "auto" or not face.caps.usable.any():
            raise
        if face.label is None or map_for_auto(face.conditioned.surface, settings) is None:
            raise  # the map was not tried, and caps would fail once more
        why = str(failure)
    found = as_found(face, settings, with_map=False)
    try:
        contact, caps = press(*given, found, *more, map_failure=why, at_ease_rad=at_ease_rad)
    except ContactError as failure:
        if str(failure) == why:  # the choice took caps, and these were both
            raise
        raise BothFailError(str(failure), why) from failure
    if found.contact.alignment == settings.contact.alignment:
        return contact, caps
    message = (
        f"neither caps ({contact.contacts} touch) nor the map find a level; the face is pressed as "
        "it was levelled, and its level decides"
    )
    lost = Problem("not_balanced", "warning", message)
    return replace(contact, problems=(*contact.problems, lost)), caps


def _pressed_as(choice: Choice, face: Face, settings: Settings) -> tuple[ContactState, CapTable]:
    """Press a face with the model that its lighter patches need, and find its error."""
    forced = msgspec.structs.replace(settings.contact, model=choice.model)
    contact, caps = _pressed(face, msgspec.structs.replace(settings, contact=forced))
    contact, doubts = _with_error(face, contact, settings)
    problems = (*contact.problems, *doubts)
    return replace(contact, model_reason=choice.reason, problems=problems), caps


def estimate(face: Face, contact: ContactState, settings: Settings, clock: Clock) -> ContactState:
    """Return a model that the settings force with its estimated error, and whether it is too great.

    It takes far longer than to press the face; the automatic choice has its estimate already.
    """
    with clock("accuracy"):
        found, doubts = _with_error(face, contact, settings)
        patches = face.joint.loaded(found, greatest_over_mean(settings.slip))
        curve = face.joint.curve_of(patches)
        alone = replace(found, problems=doubts)
        of_joint, _ = _with_errors_of_joint(face, alone, curve, patches, settings)
    more = [doubt for doubt in of_joint.problems if doubt not in contact.problems]
    return replace(of_joint, problems=(*contact.problems, *more))


def error_under(
    face: Face, contact: ContactState, load_N: float, settings: Settings
) -> ModelError | None:
    """Return the errors of a pressed face where it bears another load; None: not known.

    At the level of that load, where it finds one.

    Raises
    ------
    ContactError
        If it cannot carry the load.
    """
    if load_N == contact.preload_N:
        return _with_error(face, contact, settings)[0].errors
    lying = _lying(face, contact, load_N, settings)
    return _with_error(lying, contact.of_patch(load_N), settings)[0].errors


def knows_other_preloads(joint: Joint, contact: ContactState | None) -> bool:
    """Tell whether other preloads of a joint are those of the same caps, or families.

    Not of a map, nor of what yields, which would have to be pressed anew.
    """
    if contact is None or not joint.is_even or contact.hardness_Pa is not None:
        return False
    return contact.rung.solved_loads_N is None


def under_preload(
    face: Face, contact: ContactState, preload_N: float, settings: Settings
) -> tuple[ContactState, SlipCurve]:
    """Return an elastic face of caps, and the slip of its joint, under another preload of that.

    By the same model, and with its error: the same caps on the plane that this preload balances,
    where the face was balanced.

    Raises
    ------
    ContactError
        If the caps cannot carry it.
    """
    settings = _forced(contact, settings)
    face = _at_its_level(face, contact, face.joint.under(preload_N), settings)
    pressed, _, slip = press_face(face, settings, Clock())
    return _with_error(face, pressed, settings)[0], slip


def finds_its_level(face: Face, contact: ContactState, settings: Settings) -> bool:
    """Tell whether a pressed face would lie otherwise under another load: it was balanced."""
    if settings.contact.alignment != "balanced":
        return False
    return face.level is not None or contact.rung.made_from == "map"


def _lying_anew(
    face: Face, contact: ContactState, load_N: float, settings: Settings, fits: bool
) -> tuple[ContactState, CapTable]:
    """Return a scan after a first loading to another load, at the level of that, and its caps.

    By the same model, of the scan alone: a map turns anew, caps lie on the plane that the load
    balances. `ContactState.under` keeps the level instead. It slips in no direction yet.

    Raises
    ------
    ContactError
        If it finds no level, or not in time, or cannot carry the load; or if the bulk sinking
        cannot be taken off as it was.
    """
    joint, settings = _of_one_scan(face.joint, load_N), _forced(contact, settings)
    found = levelled_anew(face, joint, settings) if fits else None
    face = found or _at_its_level(face, contact, joint, settings)
    pressed, caps = _pressed(face, settings)
    if pressed.bulk != contact.bulk:
        raise ContactError(f"the bulk sinking cannot be taken off under {load_N:g} N")
    if any(one.code == "time_limit_reached" for one in pressed.problems):
        raise ContactError("its slip cannot be followed within contact.time_limit_s")
    return pressed, caps


def _of_one_scan(joint: Joint, load_N: float) -> Joint:
    area_m2 = joint.scan_area_m2
    return Joint(area_m2, area_m2, load_N, np.array([load_N]), np.ones(1), load_N)


def _at_its_level(face: Face, contact: ContactState, joint: Joint, settings: Settings) -> Face:
    """Return a face to press it by the same model for another joint, with `_forced` settings."""
    if contact.rung.made_from == "map":
        return replace(face, joint=joint)
    flags = np.where(contact.use, face.caps.flags, face.caps.flags | UNUSABLE)
    caps = face.caps.with_columns(flags=flags)
    if face.level is not None:
        at_m = contact.load_point_m
        given = at_m, joint.settings_of_scan(settings), contact.at_ease_rad
        caps, slope = levelled(caps, contact.use, *given)
        surface = turned(face.conditioned.surface, slope, at_m)
        face = replace(face, conditioned=replace(face.conditioned, surface=surface))
    return replace(face, joint=joint, caps=caps)


def _forced(contact: ContactState, settings: Settings) -> Settings:
    """Return settings that press a face by the model of a state, and keep the bulk as that."""
    change = {"model": contact.rung.name, "bulk": contact.bulk}
    forced = msgspec.structs.replace(settings.contact, **change)
    return msgspec.structs.replace(settings, contact=forced)


def _lying(face: Face, contact: ContactState, load_N: float, settings: Settings) -> Face:
    """Return a face as it lies under another load, or as it does if it finds no level there."""
    if contact.at_level is None or contact.at_level(load_N) is None:
        return face
    joint = _of_one_scan(face.joint, load_N)
    return _at_its_level(face, contact, joint, _forced(contact, settings))


def _with_error(face: Face, contact: ContactState, settings: Settings) -> WithDoubts:
    """Return the estimated error of a model under the load of a patch, and whether it is too great.

    Caps that answer where the choice was free are asked as if the settings forced them.
    """
    if contact.rung.error is not None:
        noise_m = known_noise_m(face.conditioned.surface, settings)
        asked = asked_of_error(settings, noise_m)
        errors, doubts = contact.rung.error(contact.curve, contact.preload_N, *asked)
        return replace(contact, errors=errors), doubts
    given = _settings_of(face, contact, settings, contact.rung.name)
    error, moved, doubts = estimate_error(*_caps_of(face), given)
    return replace(contact, errors=ModelError.of_either(error), moved=moved), doubts


def _as_chosen(
    face: Face, light: ContactState, settings: Settings
) -> tuple[ContactState, tuple[Problem, ...], Choice | None]:
    """Return caps under a light load with the error that the choice finds, and a dearer model."""
    choice = choose_model(*_caps_of(face), _settings_of(face, light, settings, "auto"))
    dearer: Choice | None = None
    if rung(choice.model).cost > light.rung.cost:
        need = f"lighter patches of the joint need it: under {light.preload_N:.3g} N on the scan, "
        dearer = replace(choice, reason=need + choice.reason)
    of_caps = choice.caps or choice
    errors = of_caps.model_errors
    if of_caps.model != light.rung.name:
        errors = ModelError.of_either(of_caps.estimates.get(light.rung.name))
    doubts: tuple[Problem, ...] = () if of_caps.problem is None else (of_caps.problem,)
    light = replace(light, errors=errors, moved=of_caps.moved)
    if errors is None and dearer is not None:
        light, doubts, dearer = _tried_alone(dearer, face, light, doubts, settings)
    return light, doubts, dearer


def _tried_alone(
    choice: Choice,
    face: Face,
    light: ContactState,
    doubts: tuple[Problem, ...],
    settings: Settings,
) -> tuple[ContactState, tuple[Problem, ...], Choice | None]:
    """Return caps under a light load with the error that a dearer model finds, if that knows more.

    One load of it takes far less time than all those of a joint, which may need none. The dearer
    model is no better where it leaves open itself most of what its answers and those of caps do.
    """
    alone = replace(face, joint=_of_one_scan(face.joint, light.preload_N))
    try:
        other, _ = _pressed_as(choice, alone, settings)
        errors = error_against(light, other)
    except ContactError:
        return light, doubts, choice
    if errors is None or other.errors is None:
        return light, doubts, choice
    light = replace(light, errors=errors)
    left = other.errors.greatest_at(ASKED)
    if 2.0 * left < errors.greatest_at(ASKED):
        return light, doubts, choice
    return light, _tried(doubts, f"may be off by {off_by(left)}"), None


def _caps_of(
    face: Face,
) -> tuple[CapTable, Families, HeightMap, np.ndarray | None, float]:
    """Return what the choice among the models takes of a face."""
    surface = face.conditioned.surface
    return face.caps, face.families, surface, face.label, face.hills.noise_m


def _settings_of(face: Face, patch: ContactState, settings: Settings, model: str) -> Settings:
    """Return the settings of a patch of the joint: its load, and the model to ask.

    A patch that found no level of its own lies as the scan does under the greatest pressure, and
    where the bulk could not be taken off there it is kept.
    """
    found = as_found(face, settings)
    conditioning = found.conditioning
    change: dict[str, Any] = {"model": model, "preload_N": patch.preload_N, "bulk": patch.bulk}
    if found.contact.alignment == "balanced" and patch.preload_N < found.contact.preload_N:
        change["alignment"] = "as_levelled"
        conditioning = msgspec.structs.replace(conditioning, form="none")  # no other plane counts
    contact = msgspec.structs.replace(found.contact, **change)
    return msgspec.structs.replace(found, contact=contact, conditioning=conditioning)


def can_be_pressed(face: Face, settings: Settings) -> bool:
    """Tell whether a face has caps, or a model that needs none, and does not tip over."""
    if any(problem.severity == "error" for problem in face.problems):
        return False
    needs_none = settings.contact.model == "auto" or made_from(settings) != "spheres"
    return bool(face.caps.usable.any()) or (needs_none and face.label is not None)


def as_found(face: Face, settings: Settings, with_map: bool = True) -> Settings:
    """Return the settings of a face: its share of the load, and how it was found to lie.

    The caps of a face that was not balanced are pressed as levelled; or the map itself, which finds
    its own balance, where the choice is free, there is time, and it is not known to fail.
    """
    settings = face.joint.settings_of_scan(settings)
    if face.level is not None or settings.contact.alignment == "as_levelled":
        return settings
    if made_from(settings) == "map":
        return settings
    one = None
    if with_map and face.label is not None:
        one = map_for_auto(face.conditioned.surface, settings)
    change = {"alignment": "as_levelled"} if one is None else {"model": one.name}
    contact = msgspec.structs.replace(settings.contact, **change)
    return msgspec.structs.replace(settings, contact=contact)
