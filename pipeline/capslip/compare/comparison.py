"""A measurement beside the model: share of the joints, misfit, and what identification finds."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from capslip.compare.identification import (
    Identified,
    friction_and_preload,
    not_resolved,
    remarks_on,
)
from capslip.compare.measurement import Measurement, joint_share, load_measurement
from capslip.compare.model import JointModel, load_model
from capslip.structure.stiffness import is_given, structure_name
from capslip.units import readable

N_CURVE = 160
NANO_BELOW_m = 1e-7  # amplitudes that are all less are in nanometres
BAND_NAMES = ("small", "middle", "great")


@dataclass(frozen=True)
class Band:
    """Misfit over a third of the logarithmic range of amplitudes; natural logarithms."""

    name: str
    least_amplitude_m: float
    greatest_amplitude_m: float
    points: int
    rms_log_ratio: float | None  # of model over measured share of the joints
    bias_log_ratio: float | None  # mean of the same: > 0, the model loses too much


@dataclass(frozen=True, eq=False)
class Comparison:
    """A measurement beside the model; arrays over the measured amplitudes (n,) or a curve (k,)."""

    amplitude_m: np.ndarray
    measured_loss_factor: np.ndarray  # assembly, all sources
    intrinsic_loss_factor: np.ndarray  # monolithic beam; NaN outside its range, 0 where not given
    joint_loss_factor: np.ndarray  # what is left for the joints; NaN where it cannot be told
    joint_energy_J: np.ndarray  # W_assembly - W_monolithic of a cycle; NaN beyond gross slip, too
    model_loss_factor: np.ndarray  # of the joints; NaN beyond gross slip
    resolved_from_m: float  # amplitude below which less slips than the model resolves
    friction_coefficient: float
    preload_N: float
    bands: tuple[Band, ...]
    identified: Identified | None
    remarks: tuple[str, ...]
    curve_amplitude_m: np.ndarray
    curve_intrinsic: np.ndarray
    curve_model: np.ndarray
    curve_plane: np.ndarray
    curve_identified: np.ndarray | None

    @property
    def amplitude_unit(self) -> tuple[str, float]:
        """Unit in which the amplitudes are written, and how many of it make a metre."""
        return ("nm", 1e9) if self.amplitude_m[-1] < NANO_BELOW_m else ("um", 1e6)

    @property
    def left_out(self) -> np.ndarray:
        """Points (n,) of which there is no misfit: no share of the joints, or no loss of the model.

        The model gives none beyond gross slip, may lose nothing below it, and knows none where less
        slips than the pixels of a map resolve.
        """
        known = np.isfinite(self.joint_loss_factor) & (self.model_loss_factor > 0.0)
        return ~(known & (self.amplitude_m >= self.resolved_from_m))


def compare_result(
    result: str | Path,
    assembly: str | Path,
    monolithic: str | Path | None = None,
    identify: bool = False,
) -> Comparison:
    """Compare a folder that `analyze` left with a measured curve.

    Parameters
    ----------
    result : path
        Folder with `settings.toml`, `summary.json` and `result.h5`.
    assembly, monolithic : path
        CSV files of two columns, see `load_measurement`.
    identify : bool
        Also fit friction coefficient and preload.

    Raises
    ------
    UnreadableFileError
        If a file is missing or damaged, or the result holds no joint.
    SettingsError
        If too few points are left to identify anything.
    """
    measured = load_measurement(assembly)
    intrinsic = load_measurement(monolithic, distinct=True) if monolithic is not None else None
    model, settings = load_model(result)
    friction, preload_N = settings.material.friction_coefficient, settings.contact.preload_N
    found = compare(measured, model, friction, preload_N, intrinsic, identify)
    if is_given(settings):
        return found
    remark = f"the structure is the {structure_name(settings)}: give that which was measured"
    return replace(found, remarks=(remark, *found.remarks))


def compare(
    assembly: Measurement,
    model: JointModel,
    friction_coefficient: float,
    preload_N: float,
    monolithic: Measurement | None = None,
    identify: bool = False,
) -> Comparison:
    """Compare the loss measured on an assembly with that of the model.

    Parameters
    ----------
    assembly, monolithic : Measurement
        Loss factors of the assembled and of the monolithic structure, see `joint_share`.
    model : JointModel
        The joints and the structure.
    friction_coefficient, preload_N : float
        Values at which the model is compared, and from which the identification starts.
    identify : bool
        Fit friction coefficient and preload, see `friction_and_preload`.

    Returns
    -------
    Comparison
        Misfit by thirds of the logarithmic range; `remarks` say what was left out and why.

    Raises
    ------
    SettingsError
        If fewer than five points are left, and resolved by the model, to identify two parameters,
        or the model loses nothing.

    Notes
    -----
    Peyret, Chevallier and Dion, Int. J. Appl. Mech. 8 (2016) 1650097, Sec. 4 and Fig. 11.
    """
    v_m = assembly.amplitude_m
    intrinsic, joint, remarks = joint_share(assembly, monolithic)
    usable = np.isfinite(joint)
    predicted = model.loss_factor(v_m, friction_coefficient, preload_N)
    stored_J = model.stored_energy_J(v_m, friction_coefficient, preload_N)
    beyond = int((usable & np.isnan(predicted)).sum())
    if beyond:
        gross_m = model.gross_slip_amplitude_m(friction_coefficient, preload_N)
        where = readable(f"{gross_m:.3g} m")
        remarks.append(
            f"{beyond} of {v_m.size} points lie beyond gross slip of the model ({where}), where it "
            "gives no loss factor"
        )
    if lossless := int((usable & (predicted == 0)).sum()):
        remarks.append(_on_lossless(lossless, int((usable & ~np.isnan(predicted)).sum())))
    from_m = model.resolved_from_m(friction_coefficient, preload_N)
    counted = v_m >= from_m
    if unresolved := int((usable & ~counted).sum()):
        below = not_resolved(unresolved, v_m.size, from_m)
        remarks.append(f"{below}: no misfit is given there")
    curve_m = np.geomspace(v_m[0], v_m[-1], N_CURVE) if v_m[0] < v_m[-1] else v_m[:1]
    identified, curve_identified = None, None
    if identify:
        identified = friction_and_preload(v_m[usable], joint[usable], model, preload_N)
        remarks += remarks_on(identified)
        curve_identified = model.loss_factor(
            curve_m, identified.friction_coefficient, identified.preload_N
        )
    return Comparison(
        amplitude_m=v_m,
        measured_loss_factor=assembly.loss_factor,
        intrinsic_loss_factor=intrinsic,
        joint_loss_factor=joint,
        joint_energy_J=2.0 * math.pi * stored_J * joint,
        model_loss_factor=predicted,
        friction_coefficient=friction_coefficient,
        preload_N=preload_N,
        resolved_from_m=from_m,
        bands=_bands(v_m, np.log(np.where(counted & (predicted > 0), predicted, np.nan) / joint)),
        identified=identified,
        remarks=tuple(remarks),
        curve_amplitude_m=curve_m,
        curve_intrinsic=np.zeros(curve_m.size) if monolithic is None else monolithic.at(curve_m),
        curve_model=model.loss_factor(curve_m, friction_coefficient, preload_N),
        curve_plane=model.plane().loss_factor(curve_m, friction_coefficient, preload_N),
        curve_identified=curve_identified,
    )


def _on_lossless(lossless: int, below: int) -> str:
    """Say at how many points below gross slip the model loses nothing, and what is left."""
    if lossless == below:
        return "the model loses nothing below gross slip: no misfit can be given there"
    return (
        f"the model loses nothing at {lossless} of {below} points below gross slip, of which no "
        f"misfit can be given: what is given is of the other {below - lossless} alone"
    )


def _bands(amplitude_m: np.ndarray, log_ratio: np.ndarray) -> tuple[Band, ...]:
    edges_m = np.geomspace(amplitude_m[0], amplitude_m[-1], len(BAND_NAMES) + 1)
    index = np.searchsorted(edges_m[1:-1], amplitude_m, side="right")
    bands = []
    for i, name in enumerate(BAND_NAMES):
        inside = log_ratio[(index == i) & np.isfinite(log_ratio)]
        rms = bias = None
        if inside.size:
            rms, bias = float(np.sqrt(np.mean(inside**2))), float(inside.mean())
        least_m, greatest_m = float(edges_m[i]), float(edges_m[i + 1])
        bands.append(Band(name, least_m, greatest_m, inside.size, rms, bias))
    return tuple(bands)
