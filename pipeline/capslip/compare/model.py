"""The model of a stored result: the loss of its joints at any friction coefficient and preload."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from capslip.caps.families import Families, Family
from capslip.caps.table import CapFlag, CapTable
from capslip.contact.balanced import levelled
from capslip.contact.curve import NormalCurve
from capslip.contact.direction import with_direction
from capslip.contact.joint import joint_of, knowing_levels
from capslip.contact.material import composite, yield_law
from capslip.contact.models.flat import flat
from capslip.contact.press import ContactState, press
from capslip.contact.reach import reachable
from capslip.contact.rung import load_point_m, rung
from capslip.contact.slip import slip_curve
from capslip.contact.varying_load import greatest_over_mean, varying
from capslip.errors import UnreadableFileError
from capslip.output.staging import SUMMARY, read_summary
from capslip.settings import Settings, SlipSettings, load_settings
from capslip.structure.response import total_loss
from capslip.structure.stiffness import stiffnesses
from capslip.surface.heightmap import HeightMap

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

TRIALS_OF_A_MAP, STEP_OF_A_MAP = 25, 2e-2


@dataclass(frozen=True)
class JointModel:
    """The loss that the joints add to one mode, for any friction coefficient and preload.

    The amplitude counts the displacement of the joints, and the loss factor the energy that they
    store: W / (2 pi F v_total / 2), which is what a decay or a resonance shows. It depends on
    v / mu and N0 alone, because displacements, forces and the root of the energy go with mu.
    """

    curve: Callable[[float], NormalCurve]  # of one joint, for a preload in N
    kappa: float
    modal_stiffness_N_per_m: float
    joint_stiffness_N_per_m: float
    joints: int
    normal_load: SlipSettings = field(default_factory=SlipSettings)
    # Preloads that an identification looks at first, odd: the one given is in their middle. A map
    # takes seconds each
    trials: int = 121
    step: float = 1e-4  # of ln N0, for differences; that of a map spans what comes and goes
    is_rough: bool = False  # whether the curve jumps with the preload
    # Share of mu N0 below which the slip of a map is not resolved, for a preload in N
    least_share: Callable[[float], float] | None = None

    def loss_factor(
        self, amplitude_m: np.ndarray, friction_coefficient: float, preload_N: float
    ) -> np.ndarray:
        """Return the loss factor at amplitudes (n,); NaN beyond gross slip.

        It is interpolated to about 0.2 % over a grid of five decades below gross slip. Further
        below it is in proportion to the amplitude.
        """
        return self.unit_curve(preload_N)(amplitude_m / friction_coefficient)

    def stored_energy_J(
        self, amplitude_m: np.ndarray, friction_coefficient: float, preload_N: float
    ) -> np.ndarray:
        """Return F v_total / 2 = K_m (f / f_0)^2 v_total^2 / 2, (n,); NaN beyond gross slip."""
        unit = self.unit_curve(preload_N)
        ratio = unit.stiffness_ratio_at(amplitude_m / friction_coefficient)
        return np.asarray(0.5 * self.modal_stiffness_N_per_m * ratio * amplitude_m**2)

    def gross_slip_amplitude_m(self, friction_coefficient: float, preload_N: float) -> float:
        """Return the amplitude beyond which nothing holds the joint."""
        return friction_coefficient * self.unit_curve(preload_N).gross_slip_amplitude_m

    def resolved_from_m(self, friction_coefficient: float, preload_N: float) -> float:
        """Return the amplitude below which less slips than the model resolves; zero for caps."""
        if self.least_share is None:
            return 0.0
        unit = self.unit_curve(preload_N)
        return friction_coefficient * unit.amplitude_at_m(self.least_share(preload_N))

    def unit_curve(self, preload_N: float, points: int = 800) -> "UnitCurve":
        """Return the loss factor over v / mu, on a grid of so many points."""
        slip = slip_curve(self.curve(preload_N), preload_N, 1.0, self.kappa)
        slip = varying(slip, self.normal_load)
        share = np.append(np.geomspace(1e-5, 0.97, points), 1 - np.geomspace(0.029, 1e-6, 60))
        share = np.append(share, 1.0)
        total_m, loss_factor, frequency_ratio = total_loss(
            slip,
            self.modal_stiffness_N_per_m,
            self.joint_stiffness_N_per_m,
            self.joints,
            share * (slip.total_slip_force_N / self.joint_stiffness_N_per_m),
        )
        return UnitCurve(total_m, loss_factor, frequency_ratio**2, share)

    def plane(self) -> "JointModel":
        """Return the same structure with perfectly plane interfaces (Peyret et al. 2010)."""
        return replace(self, curve=flat, least_share=None)


@dataclass(frozen=True, eq=False)
class UnitCurve:
    """Loss factor and frequency over amplitude up to gross slip for mu = 1, see `JointModel`."""

    amplitude_m: np.ndarray
    loss_factor: np.ndarray
    stiffness_ratio: np.ndarray  # (f / f_0)^2 = F / (K_m v_total)
    force_share: np.ndarray  # T / (mu N0), from small to one

    @property
    def gross_slip_amplitude_m(self) -> float:
        """The last amplitude."""
        return float(self.amplitude_m[-1])

    def amplitude_at_m(self, force_share: float) -> float:
        """Interpolate the amplitude at a share of the force at gross slip."""
        shares = np.append(0.0, self.force_share)
        return float(np.interp(force_share, shares, np.append(0.0, self.amplitude_m)))

    def __call__(self, amplitude_m: np.ndarray) -> np.ndarray:
        """Interpolate the loss factor; NaN beyond gross slip."""
        # eta / v is constant at small amplitudes, and so the smoothest thing to interpolate.
        return amplitude_m * self._at(amplitude_m, self._loss_per_amplitude)

    def stiffness_ratio_at(self, amplitude_m: np.ndarray) -> np.ndarray:
        """Interpolate (f / f_0)^2; NaN beyond gross slip."""
        return self._at(amplitude_m, self._stiffness)

    # Made once: a search asks one curve a hundred times, and to make it takes longer than to ask
    @cached_property
    def _loss_per_amplitude(self) -> "PchipInterpolator":
        return self._over_log(self.loss_factor / self.amplitude_m)

    @cached_property
    def _stiffness(self) -> "PchipInterpolator":
        return self._over_log(self.stiffness_ratio)

    def _over_log(self, values: np.ndarray) -> "PchipInterpolator":
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(np.log(self.amplitude_m), values)

    def _at(self, amplitude_m: np.ndarray, over_log: "PchipInterpolator") -> np.ndarray:
        inside_m = np.clip(amplitude_m, self.amplitude_m[0], self.amplitude_m[-1])
        found = over_log(np.log(inside_m))
        # the bound itself belongs to the curve, whatever the rounding of v / mu
        held = amplitude_m <= self.amplitude_m[-1] * (1 + 1e-9)
        return np.asarray(np.where(held, found, np.nan))


def load_model(result: str | Path) -> tuple[JointModel, Settings]:
    """Build the model of a result's joints from its caps, its settings and the model it used.

    The contact model is the one that the result used, at every preload: where the settings left the
    choice open it is not made again, so that the curve changes with the preload alone.

    Parameters
    ----------
    result : path
        Folder that `analyze` left.

    Returns
    -------
    JointModel, Settings
        The model, and the settings of the result with the preload of its joint.

    Raises
    ------
    UnreadableFileError
        If the folder holds no finished result, or one without a joint or of another pressure map.
    """
    folder = Path(result)
    summary = _summary_of_one_scan(folder)
    used = summary["contact"]["model"]
    if used is None:
        raise UnreadableFileError(
            f"{folder}: this analysis found no joint to compare (see its problems)"
        )
    _check_has(summary, folder, "families", "slip", "surface")
    settings = load_settings(folder / "settings.toml")
    _check_pressures(settings, summary, folder)
    surface, caps = _load_surface_and_caps(folder / "result.h5")
    families = _stored_families(summary["families"])
    material = settings.material
    composed = composite(material.youngs_modulus_Pa, material.poisson_ratio)
    whole = joint_of(settings, surface)
    law = yield_law(material)
    greatest, at_ease_rad = greatest_over_mean(settings.slip), _at_ease_rad(summary["surface"])
    has_places = rung(used).made_from == "spheres" and rung(used).knows_places
    ease_rad = at_ease_rad if has_places else None  # of caps that lie anew under another load

    @cache
    def state(preload_N: float) -> ContactState:
        found = under(whole.under(preload_N).scan_load_N)
        if whole.is_even or (found.turned is None and ease_rad is None):
            return found
        return knowing_levels(found, under)

    def under(load_N: float) -> ContactState:
        pressed, changed = caps, whole.settings_of_scan(settings)
        contact = msgspec.structs.replace(changed.contact, preload_N=load_N)
        changed = msgspec.structs.replace(changed, contact=contact)
        if ease_rad is not None:
            at_m = load_point_m(surface, changed)
            pressed, _ = levelled(caps, caps.usable, at_m, changed, ease_rad)
        if used != settings.contact.model:
            # A choice takes the caps that can touch; of thousands the others would fill the matrix.
            near = reachable(pressed, surface, composed.E_star_Pa, load_N, law).use
            pressed = _part(pressed, near)
        contact = msgspec.structs.replace(changed.contact, model=used)
        changed = msgspec.structs.replace(changed, contact=contact)
        at_rad = at_ease_rad or (0.0, 0.0)
        found, loaded = press(pressed, families, surface, changed, at_ease_rad=at_rad)
        if settings.slip.direction_rad is None:
            return found
        return with_direction(found, loaded, surface, settings)

    @cache
    def curve(preload_N: float) -> NormalCurve:
        return whole.under(preload_N).curve(state(preload_N), greatest, kappa)

    _, modal, shear = stiffnesses(settings)
    contact = msgspec.structs.replace(settings.contact, preload_N=whole.preload_N)
    settings = msgspec.structs.replace(settings, contact=contact)
    kappa = summary["slip"].get("kappa") or composed.kappa  # of the direction of slip
    stiffness = (kappa, modal, shear, settings.structure.joints)
    model = JointModel(curve, *stiffness, normal_load=settings.slip)
    if rung(used).made_from == "map":
        model = _of_a_map(model, state)
    return model, settings


def _summary_of_one_scan(folder: Path) -> dict[str, Any]:
    summary = read_summary(folder)
    if summary is None:
        raise UnreadableFileError(
            f"{folder}: holds no finished result; expected a folder that capslip analyze wrote"
        )
    if not (folder / "result.h5").exists():
        raise UnreadableFileError(
            f"{folder}: holds no result.h5, and so no face; expected a folder that capslip analyze "
            "wrote of one scan"
        )
    _check_has(summary, folder, "contact", "provenance")
    return summary


def _of_a_map(model: JointModel, state: Callable[[float], ContactState]) -> JointModel:
    def least_share(preload_N: float) -> float:
        contact = state(preload_N)
        found = contact.rung.least_share
        return 0.0 if found is None else found(contact.normal, contact.preload_N)

    trials, step = TRIALS_OF_A_MAP, STEP_OF_A_MAP
    return replace(model, trials=trials, step=step, is_rough=True, least_share=least_share)


def _check_has(summary: dict[str, Any], folder: Path, *tables: str) -> None:
    for name in tables:
        if not isinstance(summary.get(name), dict):
            raise UnreadableFileError(
                f"{folder / SUMMARY}: no table {name}; expected the summary as it was written; run "
                "the analysis again"
            )


def _check_pressures(settings: Settings, summary: dict[str, Any], folder: Path) -> None:
    mapped = settings.joint.pressure_map
    if mapped is not None and settings.sha256() != summary["provenance"]["settings_sha256"]:
        raise UnreadableFileError(
            f"{folder}: joint.pressure_map = {mapped} holds something else now than "
            "the result was made of, or is gone; run the analysis again"
        )


def _at_ease_rad(table: dict[str, Any]) -> tuple[float, float] | None:
    """Return the slopes on the stored face at which nothing turns it back; None without a level.

    It is stored at the level that was found for it; what holds the parts is at ease without that.
    """
    for step in table.get("steps") or ():
        if step["step"] == "level":
            slope_x, slope_y = step["tilt_rad"]
            return -float(slope_x), -float(slope_y)
    return None


def _part(caps: CapTable, use: np.ndarray) -> CapTable:
    return replace(caps, **{f.name: getattr(caps, f.name)[use] for f in fields(caps)})


def _stored_families(table: dict[str, Any]) -> Families:
    """Return the families as the analysis found them, from the table of its summary."""
    G, P = (None if table[name] is None else Family(**table[name]) for name in "GP")
    return Families(
        G=G,
        P=P,
        levels=tuple(Family(**level) for level in table["levels"]),
        separation=table["separation"],
        log_odds=table["log_odds"],
        count_se=table["count_se"],
        alike=False,
    )


def _load_surface_and_caps(path: Path) -> tuple[HeightMap, CapTable]:
    import h5py

    try:
        with h5py.File(path) as file:
            columns: dict[str, Any] = {name: data[()] for name, data in file["caps"].items()}
            height = file["surface/height_m"]
            known = {name: height.attrs.get(name) for name in ("noise_m", "noise_scans")}
            faces = 2 if "second_height_m" in file["surface"] else 1
            pixel_size_m = tuple(height.attrs["pixel_size_m"])
            surface = HeightMap(height[()], pixel_size_m, faces=faces, **known)
    except (OSError, KeyError) as error:
        raise UnreadableFileError(
            f"{path}: cannot be read ({error}); run the analysis again"
        ) from error
    columns["family"] = columns["family"].astype(str)
    columns["flags"] = np.array(
        [sum(CapFlag[word] for word in words.decode().split()) for words in columns["flags"]],
        dtype=np.uint16,
    )
    return surface, CapTable(**columns)
