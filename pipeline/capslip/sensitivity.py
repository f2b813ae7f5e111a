"""How far the answers hang on the choices: cut, pruning, filter and levelling, one by one."""

from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from capslip.contact.models.interacting import RUNG as EXACT
from capslip.contact.models.mean_field import RUNG as COARSE
from capslip.contact.rung import Rung, rung
from capslip.errors import CapslipError, ContactError
from capslip.pressing import press_face
from capslip.problems import Problem
from capslip.settings import Settings
from capslip.stages import Clock, find_face
from capslip.surface.blocks import block_sums
from capslip.surface.heightmap import HeightMap

ANSWERS = ("m", "n", "h_m", "radius_G_m", "radius_P_m", "approach_m", "energy_J")
OF_CONTACT = ANSWERS[-2:]  # the others are of the families
SYMBOLS = ("m", "n", "h", "R_G", "R_P", "approach with bulk", "W")
SYMBOL = dict(zip(ANSWERS, SYMBOLS, strict=True))
UNIT = dict(zip(ANSWERS, ("", "", " m", " m", " m", " m", " J"), strict=True))
CUTS = (0.02, 0.04, 0.06, 0.08, 0.10, 0.12, 0.15, 0.20, 0.25, 0.30)
PRUNING_FACTORS = (0.25, 0.5, 1.0, 2.0)
FILTER_PIXELS = (0.0, 4.0, 8.0)  # 0: no filter
MIN_FILTER_PIXELS = 4.0  # a shorter filter is not one on this grid
FILTER_FACTORS = (0.0, 0.5, 1.0, 2.0)
MIN_COARSE_POINTS = 40_000
MAX_INTERACTING = 100  # caps
LEVELLING = (
    "a tilt of some nm over the face, or a bow, decides which caps touch; a least-squares plane is "
    "tilted by where the caps lie, a form of a higher degree bowed, too; where a level floor is a "
    "third of the face, that of the lowest third of the points (conditioning.form_floor = true) is "
    "right"
)
FORCE_RATIO = 0.5  # of the force at total slip, at which W is taken


@dataclass(frozen=True, eq=False)
class Answers:
    """What one run of the stages says, in the order of `ANSWERS`; NaN for what it does not give.

    `standard_error` holds what is known of the errors: those of the counts and of h. (That of a
    family's radius is a spread of the caps, which are the same caps in every run.)
    """

    value: np.ndarray  # (7,)
    standard_error: np.ndarray  # (7,)


@dataclass(frozen=True, eq=False)
class Sweep:
    """The answers over the values of one setting.

    Attributes
    ----------
    setting : str
        Its name, `table.key`.
    name, unit : str
        How it is called and measured; `value` is in that unit.
    value : float64, shape (k,)
        Swept values, growing; the numbers of the `labels` where there are any.
    chosen : int
        Which of them the analysis uses.
    answer : float64, shape (k, 7)
        In the order of `ANSWERS`.
    stable_from, stable_to : float64, shape (7,)
        First and last value between which the answer stays within its error bar, on the way to
        either side from the chosen value.
    labels : tuple of str, shape (k,) or ()
        What the values are called where they are choices and no numbers.
    """

    setting: str
    name: str
    unit: str
    value: np.ndarray
    chosen: int
    answer: np.ndarray
    stable_from: np.ndarray
    stable_to: np.ndarray
    labels: tuple[str, ...] = ()

    @property
    def holds(self) -> np.ndarray:
        """Whether each answer bears a step of the sweep to either side, shape (7,)."""
        first, last = max(self.chosen - 1, 0), min(self.chosen + 1, len(self.value) - 1)
        held: np.ndarray = (self.stable_from <= self.value[first]) & (
            self.stable_to >= self.value[last]
        )
        return held

    @property
    def sentence(self) -> str:
        """What an engineer wants to hear: which answer is stable from where to where."""
        if self.labels:
            return self._sentence_of_choices()
        said: dict[str, list[str]] = {}
        for key, low, high in zip(ANSWERS, self.stable_from, self.stable_to, strict=True):
            if np.isfinite(self.answer[self.chosen, ANSWERS.index(key)]):
                where = f"from {low:.3g} to {high:.3g} {self.unit}"
                at = f"at {low:.3g} {self.unit} alone"
                said.setdefault(where if low < high else at, []).append(SYMBOL[key])
        ranges = [f"{_listed(names)} stable {where}" for where, names in said.items()]
        return f"{self.name}: {'; '.join(ranges)}."

    def _sentence_of_choices(self) -> str:
        said = []
        for i, key in enumerate(ANSWERS):
            column = self.answer[:, i]
            if np.isnan(column).all():
                continue
            given = [f"{x:.3g}{UNIT[key]}" if np.isfinite(x) else "none" for x in column]
            said.append(f"{SYMBOL[key]} {' / '.join(given if not self.holds[i] else given[:1])}")
        return f"{self.name}, {' / '.join(self.labels)}: {', '.join(said)}."

    def said(self, value: float) -> float | str:
        """Return a value as it is called: its label, or itself."""
        return self.labels[int(value)] if self.labels else value


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Sweeps around the chosen settings.

    Attributes
    ----------
    error_bar : float64, shape (7,)
        By how much an answer may move and still be the same: two standard errors, or the
        requested tolerance, whichever is more.
    sweeps : tuple of Sweep
        One a setting.
    """

    error_bar: np.ndarray
    sweeps: tuple[Sweep, ...]

    def problems_for(self, answering: Rung | None = None) -> tuple[Problem, ...]:
        """Return one for each setting of which a single step moves an answer beyond its error bar.

        A warning where the model that answers reads what moves: families, or the hills that the
        caps are fitted to; else information. Where none answers, all counts.
        """
        found = []
        for sweep in self.sweeps:
            moved = [ANSWERS[i] for i in np.flatnonzero(~sweep.holds)]
            if not moved:
                continue
            why = LEVELLING
            if not sweep.labels:
                step = sweep.value[max(sweep.chosen - 1, 0) : sweep.chosen + 2]
                why = (
                    f"from {step[0]:.3g} to {step[-1]:.3g} {sweep.unit} more than the error bar "
                    "lies between the answers"
                )
            names = _listed([SYMBOL[key] for key in moved])
            found.append(
                Problem(
                    f"sensitive_to_{sweep.name.split()[0]}",
                    "warning" if _is_read(sweep.setting, moved, answering) else "info",
                    f"the {sweep.name} decides on {names}: {why}; {sweep.sentence}",
                )
            )
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """Return plain dictionaries of arrays, one a setting, for the summary."""
        return {
            sweep.setting: {
                "unit": sweep.unit,
                "value": sweep.labels or sweep.value,
                "chosen": sweep.said(sweep.value[sweep.chosen]),
                **{key: sweep.answer[:, i] for i, key in enumerate(ANSWERS)},
                "stable_from": dict(zip(ANSWERS, map(sweep.said, sweep.stable_from), strict=True)),
                "stable_to": dict(zip(ANSWERS, map(sweep.said, sweep.stable_to), strict=True)),
                "sentence": sweep.sentence,
            }
            for sweep in self.sweeps
        }


def sensitivity(
    surface: HeightMap,
    settings: Settings,
    other: HeightMap | None,
    n_caps: int,
    pruning_height_m: float,
    with_contact: bool,
) -> Sensitivity:
    """Run the stages again with one setting changed at a time.

    All runs use one contact model, the interacting caps or, for more than 100 caps, the mean field
    in place of dearer ones. They are made on a map of half the rows and columns, 2 x 2 points
    averaged, if there the chosen settings give the same answers within the error bars.

    Parameters
    ----------
    surface : HeightMap
        The map as measured.
    settings : Settings
        The chosen ones. The tolerance of the contact sets the error bars from below.
    other : HeightMap or None
        The other face, as measured, where there is one.
    n_caps : int
        Usable caps that the chosen settings give.
    pruning_height_m : float
        The one that the hills were pruned with; infinite where they are whole regions.
    with_contact : bool
        False where the caps do not carry the preload: approach and W are not asked for then.

    Returns
    -------
    Sensitivity
        The cut from 2 to 30 %; the pruning, where there is one, from a quarter to twice its
        height; the S-filter from none to twice the chosen nesting index, or to eight pixels of the
        map of the runs; the form as chosen and through the lowest third of the points, or none
        and a plane. No sweep where the chosen settings give no answer.
    """
    model = settings.contact.model
    if model == "auto" or rung(model).cost >= EXACT.cost:
        cheap = EXACT if n_caps <= MAX_INTERACTING else COARSE
        settings = _with(settings, "contact.model", cheap.name)
    chosen = answers_of(surface, settings, other, with_contact)
    least = settings.contact.tolerance * np.abs(chosen.value)
    error_bar = np.fmax(2.0 * chosen.standard_error, least)
    if np.isnan(chosen.value).all():
        return Sensitivity(error_bar, ())
    if np.isfinite(pruning_height_m):
        # An automatic pruning would follow the cut and the filter: one choice at a time.
        settings = _with(settings, "hills.pruning_height_m", pruning_height_m)
    coarse = _coarsened(surface)
    if coarse is not None:
        on_coarse = answers_of(coarse, settings, other, with_contact)
        if _same(on_coarse.value, chosen.value, error_bar).all():
            surface, chosen = coarse, on_coarse
    sweeps = []
    for plan in _plans(settings, surface, pruning_height_m):
        value = np.unique([*plan.values, plan.chosen])
        at = int(np.searchsorted(value, plan.chosen))
        rows = [
            chosen
            if i == at
            else answers_of(surface, _with(settings, plan.setting, x), other, with_contact)
            for i, x in enumerate(plan.options or value.tolist())
        ]
        sweeps.append(_sweep(plan, value, at, np.array([row.value for row in rows]), error_bar))
    return Sensitivity(error_bar, tuple(sweeps))


def answers_of(
    surface: HeightMap, settings: Settings, other: HeightMap | None, with_contact: bool
) -> Answers:
    """Run the stages once; NaN for what they do not give.

    Parameters
    ----------
    surface, settings, other, with_contact
        As for `sensitivity`.
    """
    clock = Clock()  # nobody reads it
    try:
        face = find_face(surface, settings, other, clock)
    except CapslipError:
        none = np.full(len(ANSWERS), np.nan)
        return Answers(none, none)
    approach_m, energy_J = None, None
    if with_contact and face.caps.usable.any():
        try:
            contact, _, slip = press_face(face, settings, clock)
            energy_J = float(slip.energy_at_force_J(FORCE_RATIO * slip.total_slip_force_N))
            approach_m = contact.approach_m
        except ContactError:
            pass
    families = face.families
    G, P = families.G, families.P
    value = (
        families.m or None,  # where there is no such family, nothing can be stable
        families.n or None,
        families.h_m,
        G.radius_m if G else None,
        P.radius_m if P else None,
        approach_m,
        energy_J,
    )
    error = (families.count_se, families.count_se, families.h_se_m, *[None] * 4)
    return Answers(np.array(value, dtype=float), np.array(error, dtype=float))


@dataclass(frozen=True)
class _Plan:
    """What is swept; values in the unit of the setting."""

    setting: str
    name: str
    unit: str
    unit_size: float
    values: tuple[float, ...]
    chosen: float
    options: tuple[Any, ...] = ()  # what the values number, where they are choices
    labels: tuple[str, ...] = ()


def _plans(settings: Settings, surface: HeightMap, pruning_m: float) -> list[_Plan]:
    cut = settings.hills.material_ratio
    plans = [_Plan("hills.material_ratio", "cut", "%", 0.01, CUTS, cut)]
    if np.isfinite(pruning_m):
        heights_m = tuple(factor * pruning_m for factor in PRUNING_FACTORS)
        plans.append(_Plan("hills.pruning_height_m", "pruning", "nm", 1e-9, heights_m, pruning_m))
    index_m = settings.conditioning.s_filter_nesting_index_m
    pixel_m = max(surface.pixel_size_m)
    factors, unit_m = (FILTER_FACTORS, index_m) if index_m else (FILTER_PIXELS, pixel_m)
    lengths_m = [factor * unit_m for factor in factors]
    shortest_m, longest_m = MIN_FILTER_PIXELS * pixel_m, min(surface.side_m)
    possible = tuple(x for x in lengths_m if not x or shortest_m <= x <= longest_m)
    setting = "conditioning.s_filter_nesting_index_m"
    plans.append(_Plan(setting, "filter", "µm", 1e-6, possible, index_m or 0.0))
    plans.append(_levelling(settings))
    return plans


def _levelling(settings: Settings) -> _Plan:
    """Return the other way to level: nobody knows how a face lay under the instrument."""
    form = settings.conditioning.form
    if form == "none":
        options: tuple[Any, ...] = ("none", "plane")
        labels, setting, chosen = ("no form removed", "plane"), "conditioning.form", 0.0
    else:
        fit = "robust" if settings.conditioning.form_robust else "least-squares"
        options, labels = (False, True), (f"{fit} {form}", f"{form} of the lowest third")
        setting, chosen = "conditioning.form_floor", float(settings.conditioning.form_floor)
    return _Plan(setting, "levelling", "", 1.0, (0.0, 1.0), chosen, options, labels)


def _is_read(setting: str, moved: list[str], answering: Rung | None) -> bool:
    """Tell whether a model reads what a setting moves: the map is neither cut nor pruned for it."""
    if answering is None or answering.reads_families:
        return True
    if setting.startswith("hills.") and answering.made_from != "spheres":
        return False
    return not set(OF_CONTACT).isdisjoint(moved)


def _sweep(
    plan: _Plan, value: np.ndarray, at: int, answer: np.ndarray, error_bar: np.ndarray
) -> Sweep:
    first, last = _run_around(_same(answer, answer[at], error_bar), at)
    value = value / plan.unit_size
    return Sweep(
        setting=plan.setting,
        name=plan.name,
        unit=plan.unit,
        value=value,
        chosen=at,
        answer=answer,
        stable_from=value[first],
        stable_to=value[last],
        labels=plan.labels,
    )


def _same(answer: np.ndarray, chosen: np.ndarray, error_bar: np.ndarray) -> np.ndarray:
    """Tell whether answers are those chosen, within their error bars; none is the same as none."""
    same: np.ndarray = np.abs(answer - chosen) <= error_bar
    return same | (np.isnan(answer) & np.isnan(chosen))


def _run_around(same: np.ndarray, at: int) -> tuple[np.ndarray, np.ndarray]:
    """First and last row of the unbroken run of True around row `at`, for each column."""
    below = np.cumprod(same[at::-1], axis=0).sum(axis=0)
    above = np.cumprod(same[at:], axis=0).sum(axis=0)
    return at + 1 - below, at - 1 + above


def _coarsened(surface: HeightMap) -> HeightMap | None:
    """Average 2 x 2 points, the measured ones of each; None for a map that is small anyway."""
    points = block_sums(surface.measured, 2)
    if points.size < MIN_COARSE_POINTS:
        return None
    sum_m = block_sums(np.where(surface.measured, surface.height_m, 0.0), 2)
    height_m = np.where(points > 0, sum_m / np.maximum(points, 1), np.nan)
    dy_m, dx_m = surface.pixel_size_m
    return replace(surface, height_m=height_m, pixel_size_m=(2.0 * dy_m, 2.0 * dx_m))


def _with(settings: Settings, setting: str, value: float | str | bool) -> Settings:
    """Return the settings with one changed."""
    table, key = setting.split(".")
    changes: dict[str, Any] = {key: value}
    if key == "pruning_height_m":
        changes["pruning_percent_Sz"] = None  # the other way to say it
    if key == "s_filter_nesting_index_m" and not value:
        changes[key] = None  # a filter of no length
    inner = msgspec.structs.replace(getattr(settings, table), **changes)
    return msgspec.structs.replace(settings, **{table: inner})


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
