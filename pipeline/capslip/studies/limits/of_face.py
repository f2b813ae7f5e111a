"""The true answers of a face that is more than separate caps: boundary elements on finer pixels."""

from dataclasses import dataclass

import numpy as np

from capslip.contact.bulk import bulk_of_face_m_per_N
from capslip.contact.map_accuracy import PIXELS_95
from capslip.contact.material import composite
from capslip.contact.rung import load_point_m, turning_stiffness
from capslip.contact.solvers.elastic_face import elastic_face
from capslip.contact.solvers.path import Path
from capslip.contact.solvers.polonsky_keer import press
from capslip.contact.solvers.tilting import press_balanced
from capslip.contact.solvers.unloading import PATCH_ERROR
from capslip.settings import Settings
from capslip.studies.faces.synthetic import synthetic_surface
from capslip.studies.limits.case import Case, clean
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap

FINER = (2, 4)  # points along the side of a pixel of the scan
LEFT = 0.01  # of an energy, that pixels may leave: a tenth of the error that is wrong


@dataclass(frozen=True)
class OfFace:
    """What a face answers, and by how much its pixels may still move that."""

    approach_m: float  # without the bulk sinking
    stiffness_N_per_m: float  # the same, unless nothing would be left
    energy_J: tuple[float, ...]  # at the shares of the case
    uncertainty: float  # relative, of each


def answers_of_face(case: Case, settings: Settings) -> OfFace:
    """Press the face itself, on pixels so small that those of its scan play no part.

    A face is a function of place, and its scan holds the values at the centres of its pixels. Here
    the function is taken on pixels of half of that or, where these leave more than `LEFT` in an
    energy, of a quarter. What pixels leave in the energy of a solved load is found from the width,
    in pixels, of the ring that has let go around each contact, see `path`.

    Raises
    ------
    ContactError
        If boundary elements find no answer.
    """
    for finer in FINER:
        found = _pressed(case, settings, finer)
        if found.uncertainty <= LEFT and all(found.energy_J):
            break
    return found


def _pressed(case: Case, settings: Settings, finer: int) -> OfFace:
    """Return the answers on pixels so many times as small."""
    material, preload_N = settings.material, case.preload_N
    joint = composite(material.youngs_modulus_Pa, material.poisson_ratio)
    level = _level_face(case, finer)
    face, tolerance = elastic_face(level, joint.E_star_Pa), settings.contact.solver_tolerance
    if settings.contact.alignment == "balanced":
        pressed = press_balanced(
            face,
            preload_N,
            load_point_m(level, settings),
            rotational_stiffness_Nm_per_rad=turning_stiffness(settings),
            tolerance=tolerance,
        )
        face = face.tilted(pressed.tilt_rad)
    else:
        pressed = press(face, load_N=preload_N, tolerance=tolerance)
    for on_patches in (True, False):
        path = Path(face, pressed, tolerance, on_patches)
        nodes = [path.at(share) for share in case.shares]
        if path.patch_error() <= PATCH_ERROR:
            break
    # Where nothing has let go no energy is lost, and pixels leave nothing in it
    left = [PIXELS_95[0.25] * node.pixel_error for node in nodes if node.region_loss_J.any()]
    bulk_m_per_N = bulk_of_face_m_per_N(level, joint.E_star_Pa)
    rest_m_per_N = 1.0 / path.stiffness_N_per_m - bulk_m_per_N
    stiffness_N_per_m = 1.0 / rest_m_per_N if rest_m_per_N > 0.0 else path.stiffness_N_per_m
    loss = material.friction_coefficient**2 * joint.kappa
    return OfFace(
        path.pressed.approach_m - bulk_m_per_N * preload_N,
        stiffness_N_per_m / joint.kappa,
        tuple(loss * float(np.sum(node.region_loss_J)) for node in nodes),
        max([LEFT, *left]),
    )


def _level_face(case: Case, finer: int) -> HeightMap:
    """Return the face on finer pixels, level by its own least squares."""
    face, truth = synthetic_surface(clean(case.scene), case.name, finer)
    if case.face_change is not None:
        face = case.face_change(face, truth, finer)
    return remove_form(face, "plane")[0]
