"""A pressed face under another load or with another hardness, at next to no cost."""

from dataclasses import dataclass, replace

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.pixels import around_contact, in_contact_alone, on_contact
from capslip.contact.solvers.polonsky_keer import first_loading, press
from capslip.contact.solvers.pressed import Pressed

_TOLERANCE = 1e-7  # of a first loading: at 1e-5 the loss of rough faces is off by tens of per cent
_LEFT, _LOOSEST, _FINEST = 1e-2, 1e-5, 1e-9  # of the loss, that gaps may be; tolerances below it
_HALVINGS = 30  # of the interval in which a start is sought


@dataclass(frozen=True)
class Nearby:
    """What slip asks of a face under a load: its approach, and one partial withdrawal."""

    approach_m: float
    withdrawal_m: float
    loss_J: float


def nearby(
    face: ElasticFace,
    pressed: Pressed,
    changes: list[tuple[float, float]],
    share: float,
) -> list[Nearby]:
    """Return the states of a face after other first loadings than the one that is known.

    Solved on the points alone that touch under the known load: with less load or more hardness no
    others do. Each change is one solution from the known pressures, and one of what is left when
    the share of the load is gone, whose loss follows as in `unloading.unload`.

    Parameters
    ----------
    face : ElasticFace
        Before any load, with its hardness.
    pressed : Pressed
        Its state under the known load.
    changes : list of (float, float)
        Factors <= 1 on the load and >= 1 on the hardness.
    share : float
        Of the load, between 0 and 1.

    Raises
    ------
    ContactError
        If a solution fails.
    """
    alone, known = on_contact(face, pressed, around_contact(face, pressed.pressure_Pa > 0))
    return [
        _loaded(
            replace(alone, hardness_Pa=face.hardness_Pa * of_hardness),
            known.pressure_Pa * of_load,
            pressed.load_N * of_load,
            share,
        )
        for of_load, of_hardness in changes
    ]


def _loaded(face: ElasticFace, start_Pa: np.ndarray, load_N: float, share: float) -> Nearby:
    state = press(face, load_N=load_N, tolerance=_TOLERANCE, start_Pa=start_Pa)
    if not np.isinf(face.hardness_Pa):
        face, state = first_loading(face, state)
    touching = state.pressure_Pa > 0.0
    elastic, pressure_Pa = in_contact_alone(face, state.pressure_Pa), state.pressure_Pa[touching]
    gone = 1.0 - (1.0 - share) ** (2.0 / 3.0)  # of the approach, in a Hertz contact
    left = press(
        elastic,
        load_N=(1.0 - share) * load_N,
        tolerance=max(min(_LOOSEST, _LEFT * gone**3 / 8.0), _FINEST),
        start_Pa=_start_Pa(pressure_Pa, share),
    )
    open_m = np.where(left.pressure_Pa > 0.0, 0.0, np.maximum(left.gap_m, 0.0))
    loss_J = 4.0 * float(pressure_Pa @ open_m) * face.pixel_area_m2
    return Nearby(state.approach_m, state.approach_m - left.approach_m, loss_J)


def _start_Pa(pressure_Pa: np.ndarray, share: float) -> np.ndarray:
    """Return pressures of equal spheres when a share of their load is gone: p^2 falls evenly."""
    square, least, most = np.square(pressure_Pa), 0.0, float(pressure_Pa.max()) ** 2
    total_Pa = (1.0 - share) * float(pressure_Pa.sum())
    for _ in range(_HALVINGS):
        middle = 0.5 * (least + most)
        more = np.sqrt(np.maximum(square - middle, 0.0)).sum() > total_Pa
        least, most = (middle, most) if more else (least, middle)
    return np.sqrt(np.maximum(square - least, 0.0))
