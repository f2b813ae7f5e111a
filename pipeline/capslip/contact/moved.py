"""Interacting caps that are moved: many sets of them, each pressed with the same load."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from capslip.caps.table import CapTable
from capslip.contact.balanced import rebalanced
from capslip.contact.flattening import flattened
from capslip.contact.models.interacting import RUNG, InteractingCurve
from capslip.contact.rung import Scene, pairs_in_balance
from capslip.contact.solvers.balance import press, press_sets
from capslip.contact.solvers.hertz import coefficient_of
from capslip.errors import ContactError
from capslip.settings import Settings


@dataclass(frozen=True, eq=False)
class MovedCurve(InteractingCurve):
    """Sets of interacting caps at the same places, known at one load: there, and as they slip.

    Made by `moved_caps`.
    """

    pressed_N: float = field(kw_only=True)
    level_m: np.ndarray = field(kw_only=True)  # (s,)
    compression_m: np.ndarray = field(kw_only=True)  # (s, n)

    def _pressed(self, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if load.ndim > 0 or float(load) != self.pressed_N:
            raise ContactError(
                f"{self.model}: caps that were moved are known under {self.pressed_N:g} N; got "
                f"{load} N"
            )
        return self.level_m, self.compression_m

    def _compression(self, approach_m: ArrayLike) -> np.ndarray:
        return self.compression_m


def moved_caps(
    scene: Scene,
    curve: InteractingCurve,
    up_m: np.ndarray,
    log_radius: np.ndarray,
    settings: Settings,
) -> MovedCurve:
    """Return the curve of sets of caps that are higher and wider than those of another curve.

    Parameters
    ----------
    scene : Scene
        The face, with the caps in use.
    curve : InteractingCurve
        Of these.
    up_m, log_radius : float64, shape (s, n)
        By how much each cap in use is higher, and the logarithm of the factor on its radius.
    settings : Settings
        `contact`: whether the face balances anew.

    Raises
    ------
    ContactError
        If a set cannot carry the load.
    """
    load_N = curve.asperity_loads_N(curve.approach_m(scene.preload_N))
    start_m = np.broadcast_to((load_N / curve.coefficient) ** (2 / 3), up_m.shape)
    radius_m = scene.radius_m * np.exp(log_radius)
    peak_m = scene.caps.peak_height_m[scene.use] + up_m
    if scene.law is not None:
        sets = zip(peak_m, radius_m, start_m, strict=True)
        each = [_flattened(scene, *one, settings) for one in sets]
        peak_m, radius_m, start_m = (np.array(one) for one in zip(*each, strict=True))
    elif settings.contact.alignment == "balanced":
        peak_m, start_m = _balanced(scene, curve, peak_m, radius_m, start_m, settings)
    depth_m = _depth_m(peak_m)
    face = curve.pair_compliance_m_per_N, start_m, scene.preload_N
    k = coefficient_of(radius_m, scene.E_star_Pa)
    level_m, _, g = press_sets(k, depth_m, *face, near=curve.near)
    return MovedCurve(
        *(RUNG.name, np.ones_like(radius_m), radius_m, depth_m, scene.E_star_Pa),
        x_m=curve.x_m,
        y_m=curve.y_m,
        pair_compliance_m_per_N=curve.pair_compliance_m_per_N,
        near=curve.near,
        pressed_N=scene.preload_N,
        level_m=level_m,
        compression_m=g,
    )


def _balanced(
    scene: Scene,
    curve: InteractingCurve,
    peak_m: np.ndarray,
    radius_m: np.ndarray,
    start_m: np.ndarray,
    settings: Settings,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the peaks over the planes that balance them, and their compressions."""
    caps, use, load_N = scene.caps, scene.use, scene.preload_N
    arm_m = np.column_stack((caps.x_m, caps.y_m))[use] - scene.load_point_m
    C = pairs_in_balance(arm_m, scene.E_star_Pa, settings)
    near = None if C is None else curve.near
    moment_Nm = np.zeros(2)
    if scene.turning_stiffness > 0.0:  # what held the face upright was at ease with caps as found
        k, depth_m = coefficient_of(scene.radius_m, scene.E_star_Pa), scene.depth_m
        held_m = press(k, depth_m, C, start_m[0], load=load_N, near=near).compression_m
        moment_Nm = k * np.maximum(held_m, 0.0) ** 1.5 @ arm_m
    turning = arm_m, scene.turning_stiffness, moment_Nm
    k, depth_m = coefficient_of(radius_m, scene.E_star_Pa), _depth_m(peak_m)
    _, slope, g = press_sets(k, depth_m, C, start_m, load_N, *turning, near=near)
    return peak_m + slope @ arm_m.T, g


def _flattened(
    scene: Scene, peak_m: np.ndarray, radius_m: np.ndarray, start_m: np.ndarray, settings: Settings
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return peaks, radii and compressions of one set of caps that yield, balanced anew."""
    caps, use = scene.caps, scene.use
    peaks_m, radii_m = caps.peak_height_m.copy(), caps.radius_m.copy()
    peaks_m[use], radii_m[use] = peak_m, radius_m
    moved: CapTable = caps.with_columns(peak_height_m=peaks_m, radius_m=radii_m)
    start: np.ndarray | None = start_m
    if settings.contact.alignment == "balanced":
        moved, start = rebalanced(moved, caps, use, scene.load_point_m, settings, start_m)
    flat = flattened(RUNG, replace(scene, caps=moved, start_m=start))
    assert flat.start_m is not None
    return flat.caps.peak_height_m[use], flat.radius_m, flat.start_m


def _depth_m(peak_m: np.ndarray) -> np.ndarray:
    """Return how far peaks lie below the highest of their set."""
    return np.asarray(peak_m.max(axis=-1, keepdims=True) - peak_m)
