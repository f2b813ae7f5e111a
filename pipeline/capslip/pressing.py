"""A face under its share of the preload, and the joint under shear.

What a pressed face says of its own error is said here, too: of a joint that is pressed unevenly,
under the lightest load that counts.
"""

from dataclasses import replace

import msgspec

from capslip.caps.table import CapTable
from capslip.contact.choice import boundary_elements_s, estimate_error, map_for_auto
from capslip.contact.direction import with_direction
from capslip.contact.press import ContactState, press
from capslip.contact.rung import ModelError, made_from
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.contact.uneven_accuracy import (
    error_of_joint,
    error_of_patches,
    problems_of_patches,
)
from capslip.contact.varying_load import greatest_over_mean, varying
from capslip.errors import ContactError
from capslip.problems import Problem
from capslip.settings import Settings
from capslip.stages import Clock, Face
from capslip.surface.noise import known_noise_m

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
    with clock("contact", boundary_elements_s(shape) if needs_map else None):
        contact, caps = _pressed(face, settings)
    with clock("slip"):
        contact = with_direction(contact, caps, face.conditioned.surface, settings)
        friction, kappa = settings.material.friction_coefficient, contact.composite.kappa
        patches = face.joint.loaded(contact, greatest_over_mean(settings.slip))
        curve = face.joint.curve_of(patches)
        slip = varying(slip_curve(curve, face.joint.preload_N, friction, kappa), settings.slip)
        left = error_of_patches(face.joint, patches)
        doubts = problems_of_patches(face.joint, patches, left, settings.contact.tolerance)
        known = settings.contact.tolerance, known_noise_m(face.conditioned.surface, settings)
        errors, said = error_of_joint(face.joint, curve, patches, contact.problems, *known)
    found = replace(contact, patch_errors=left, errors=errors, problems=(*said, *doubts))
    return found, caps, slip


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
            contact, doubts = _error_of_map(replace(contact, model_reason=reason), face, settings)
            contact = replace(contact, problems=(*contact.problems, *doubts))
        return contact, caps
    except ContactError as failure:
        if settings.contact.model != "auto" or not face.caps.usable.any():
            raise
        why = str(failure)
    found = as_found(face, settings, with_map=False)
    try:
        contact, caps = press(*given, found, *more, map_failure=why, at_ease_rad=at_ease_rad)
    except ContactError as failure:
        raise ContactError(f"{failure}; the map itself: {why}") from failure
    if found.contact.alignment == settings.contact.alignment:
        return contact, caps
    message = (
        f"neither caps ({contact.contacts} touch) nor the map find a level; the face is pressed as "
        "it was levelled, and its level decides"
    )
    lost = Problem("not_balanced", "warning", message)
    return replace(contact, problems=(*contact.problems, lost)), caps


def estimate(face: Face, contact: ContactState, settings: Settings, clock: Clock) -> WithDoubts:
    """Return a model that the settings force with its estimated error, and whether it is too great.

    It takes far longer than to press the face; the automatic choice has its estimate already.
    """
    settings = as_found(face, settings)
    with clock("accuracy"):
        if contact.rung.error is not None:
            contact, doubts = _error_of_map(contact, face, settings)
            patches = face.joint.loaded(contact, greatest_over_mean(settings.slip))
            curve = face.joint.curve_of(patches)
            known = settings.contact.tolerance, known_noise_m(face.conditioned.surface, settings)
            errors, doubts = error_of_joint(face.joint, curve, patches, doubts, *known)
            return replace(contact, errors=errors), doubts
        caps = (face.caps, face.families, face.conditioned.surface, face.label, face.hills.noise_m)
        error, moved, doubts = estimate_error(*caps, settings)
    return replace(contact, errors=ModelError.of_either(error), moved=moved), doubts


def _error_of_map(contact: ContactState, face: Face, settings: Settings) -> WithDoubts:
    """Return a model that knows its own error with that, and whether it is too great."""
    assert contact.rung.error is not None
    known = settings.contact.tolerance, known_noise_m(face.conditioned.surface, settings)
    errors, doubts = contact.rung.error(contact.normal, contact.preload_N, *known)
    return replace(contact, errors=errors), doubts


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
