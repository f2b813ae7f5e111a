"""The axis along which caps lie off balance, and tilt the least-squares plane."""

from dataclasses import replace

import numpy as np

from capslip.studies.limits_cases import Axis, Case, harmless_faces
from capslip.surface.form import remove_form
from capslip.surface.synthetic import Scene, synthetic_surface

DRAWS, EVERY = 20, 3  # of 20 draws of the places, sorted by the tilt, every third


def axes_of_levelling(seed: int = 0) -> tuple[Axis, ...]:
    """Return the axis: the harmless faces, with their caps where they fall.

    The floor is level and the truth is that of the caps as placed. How far the plane of caps and
    floor is tilted against it is the severity, to one digit.

    Examples
    --------
    >>> (axis,) = axes_of_levelling()
    >>> axis.name, len(axis.cases)
    ('levelling', 21)
    """
    cases = []
    for name, (face, preload_N) in harmless_faces(seed).items():
        fallen = []
        for i in range(1, DRAWS + 1):
            scene = replace(face, seed=face.seed + i, balanced=False)
            text = f"caps where they fall, draw {i}, {name}"
            fallen.append(Case("levelling", _tilt_m(scene), text, scene, preload_N))
        cases += sorted(fallen, key=lambda case: case.severity)[::EVERY]
    cases.sort(key=lambda case: case.severity)
    quantity = "tilt of the least-squares plane [m]"
    return (
        Axis("levelling", quantity, ("sensitive_to_levelling", "levelling_decides"), tuple(cases)),
    )


def _tilt_m(scene: Scene) -> float:
    """Rise of the least-squares plane over the face, corner to corner, to one digit."""
    surface, _ = synthetic_surface(scene)
    level, _ = remove_form(surface, "plane")
    return float(f"{np.ptp(surface.height_m - level.height_m):.0e}")
