"""The face under its preload: the normal curve that the settings ask for, and its state."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import msgspec
import numpy as np

from capslip.caps.families import Families
from capslip.caps.table import CapTable
from capslip.contact.accuracy import MovedCaps
from capslip.contact.bulk import bulk_of_face_m_per_N, problems_of_bulk, without_bulk
from capslip.contact.choice import Choice, choose_model
from capslip.contact.curve import NormalCurve
from capslip.contact.flattening import flattened, left_m, loaded_first
from capslip.contact.lay import Lay
from capslip.contact.map_doubts import ASKED, BLURRED
from capslip.contact.material import Composite, composite
from capslip.contact.rung import Contacts, ModelError, Rung, Scene, asked_of_error, rung
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.contact.varying_load import greatest_over_mean
from capslip.errors import ContactError
from capslip.problems import Effect, Problem, Severity
from capslip.settings import Settings
from capslip.surface.heightmap import HeightMap
from capslip.units import percent

CLOSING = 0.25  # of the face in contact: metals carry their hardness long before
FULL = 1.0 - 1e-6  # of the measured face in contact: no gap is left for a model of contact


@dataclass(frozen=True, eq=False)
class ContactState:
    """The face under its preload."""

    rung: Rung
    model_reason: str
    errors: ModelError | None  # None: not known
    moved: MovedCaps | None  # a part of it; None: not known, or the caps were not pressed
    preload_N: float
    # From first touch, half-space bulk term included where the model has one; of a face that
    # yielded, what it recovers on unloading
    approach_m: float
    bulk_m: float  # that term at the preload; 0 where the model has none
    bulk: bool  # whether the curve below holds the bulk term
    contacts: int
    overlapping_pairs: int  # of contacts: where there are any, the caps do not hold
    stiffness_N_per_m: float  # of the curve that slip uses
    contact_area_m2: float | None
    max_pressure_Pa: float | None
    use: np.ndarray  # (n,), the caps that the curve is made from; none for a model without caps
    row_family: np.ndarray  # "G", "P" or "" for each row of the curve
    normal: NormalCurve  # the whole curve N(d)
    curve: NormalCurve  # the one that slip uses, with or without the bulk term as chosen
    composite: Composite
    load_point_m: tuple[float, float]  # place (x, y) of the line of action
    eccentricity_m: tuple[float, float] | None  # of the resultant of the contacts, from there
    tilt_rad: tuple[float, float]  # slopes (x, y) that the model itself added to the map
    problems: tuple[Problem, ...]
    hardness_Pa: float | None = None  # of the softer face; None: all stays elastic
    yielded_area_m2: float | None = None  # of the contact area; None as well
    # By how much nearer the faces are for good after the first loading; None: not known, or as well
    left_m: float | None = None
    # The curve for slip after a first loading to a load, at a hardness by a factor; None as well
    first: Callable[[float, float], NormalCurve] | None = None
    at_ease_rad: tuple[float, float] = (0.0, 0.0)  # slopes at which nothing turns the face back
    # The curve for slip of a map that turns, at the level that another load finds
    turned: Callable[[float], NormalCurve] | None = None
    # The scan at the level of another load, None where it finds none; without it all lie as this
    at_level: Callable[[float], "ContactState | None"] | None = None
    # What few solved pressures leave of a joint of many; None: each has its own, or any is as good
    patch_errors: ModelError | None = None
    # The lightest patch that counts of an uneven joint, with its errors; None: none, or not known
    light: "ContactState | None" = None
    energy_share: np.ndarray | None = None  # of each patch, at a quarter of mu N; None as well
    lay: Lay | None = None  # what the direction of slip does, see `direction`; None: not looked at
    kappa_along: Callable[[NormalCurve, float], float] | None = None  # as well; None: one of all

    @property
    def model(self) -> str:
        """Name of the contact model."""
        return self.rung.name

    @property
    def estimated_error(self) -> float | None:
        """Greater of the errors of stiffness and energy, at 95 %; None: not known."""
        return None if self.errors is None else self.errors.greatest

    @property
    def yielded_share(self) -> float:
        """Of the contact area, 0 where nothing yields or no area is known."""
        return (self.yielded_area_m2 or 0.0) / (self.contact_area_m2 or np.inf)

    def curve_after(self, load_N: float, hardness_factor: float = 1.0) -> NormalCurve:
        """Return the curve for slip after a first loading to a load; all the same where elastic.

        Raises
        ------
        ContactError
            If the face cannot carry the load.
        """
        if self.first is None or (load_N == self.preload_N and hardness_factor == 1.0):
            return self.curve
        return self.first(load_N, hardness_factor)

    def of_patch(self, load_N: float) -> "ContactState":
        """Return a patch of the joint after its first loading to a load, at the level of that.

        One that finds none lies as the scan does under its own load.

        Raises
        ------
        ContactError
            If the face cannot carry the load.
        """
        if self.at_level is None or load_N == self.preload_N:
            return self.under(load_N)
        return self.at_level(load_N) or self.under(load_N)

    def lacks_level(self, load_N: float) -> bool:
        """Tell whether another load finds no level, so that the face lies as under its own."""
        if self.at_level is None or math.isclose(load_N, self.preload_N):
            return False
        return self.at_level(load_N) is None

    def under(self, load_N: float, curve: NormalCurve | None = None) -> "ContactState":
        """Return what slip, errors and doubts ask of the face after a first loading to a load.

        At the level of the known one, or along a curve that is known.

        Raises
        ------
        ContactError
            If the face cannot carry the load.
        """
        curve, count = curve or self.curve_after(load_N), self.rung.touching
        bulk_m, joint = self.bulk_m * (load_N / self.preload_N), self.composite
        if self.kappa_along is not None:
            joint = replace(joint, kappa=self.kappa_along(curve, load_N))
        return replace(
            self,
            preload_N=load_N,
            approach_m=float(curve.approach_m(load_N)) + (0.0 if self.bulk else bulk_m),
            left_m=None,
            bulk_m=bulk_m,
            contacts=self.contacts if count is None else count(curve, load_N),
            normal=curve,
            curve=curve,
            composite=joint,
            errors=None,
            moved=None,
            light=None,
            energy_share=None,
        )

    def curves_near(
        self, changes: Sequence[tuple[float, float]], share: float, greatest: float = 1.0
    ) -> list[NormalCurve]:
        """Return the curves for slip after first loadings near the preload.

        Parameters
        ----------
        changes : sequence of (float, float)
            Factors on the preload and on the hardness.
        share : float
            Of the preload, at whose withdrawal they are to be good.
        greatest : float
            Times each preload, to which a load that oscillates goes: they are good up to there.

        Raises
        ------
        ContactError
            If the face cannot carry a load.
        """
        if self.rung.near is not None and greatest == 1.0:
            return self.rung.near(self.curve, self.preload_N, changes, share)
        most_N = greatest * self.preload_N
        return [self.curve_after(most_N * N, hardness) for N, hardness in changes]

    @property
    def approach_without_bulk_m(self) -> float | None:
        """Approach less the bulk term; None where that would be negative."""
        return self._without_bulk_m(self.approach_m)

    @property
    def first_loading_approach_m(self) -> float | None:
        """Approach on the first loading, the same where nothing yielded; None: not known."""
        if self.yielded_area_m2 and self.left_m is None:
            return None
        return self.approach_m + (self.left_m or 0.0)

    @property
    def first_loading_approach_without_bulk_m(self) -> float | None:
        """The same less the bulk term; None where that would be negative as well."""
        return self._without_bulk_m(self.first_loading_approach_m)

    def _without_bulk_m(self, approach_m: float | None) -> float | None:
        rest_m = None if approach_m is None else approach_m - self.bulk_m
        return None if rest_m is None or rest_m < 0.0 else rest_m


def press(  # long: one state, field by field
    caps: CapTable,
    families: Families,
    surface: HeightMap,
    settings: Settings,
    label: np.ndarray | None = None,
    noise_m: float = 0.0,
    map_failure: str = "",
    at_ease_rad: tuple[float, float] = (0.0, 0.0),
) -> tuple[ContactState, CapTable]:
    """Choose the normal curve and press the face with the preload.

    Parameters
    ----------
    caps : CapTable
        Caps of the face, at least one of them usable.
    families : Families
        Their families.
    surface : HeightMap
        Heights after removal of the form; its sides give the bulk sinking of the half-space.
    settings : Settings
        `material` and `contact`.
    label : int, shape (ny, nx), optional
        The hills of the caps, for the choice of the model.
    noise_m : float
        Standard deviation of the noise of the map, for the choice of the model.
    map_failure : str
        Why the map itself cannot be pressed, for the choice of the model.
    at_ease_rad : (float, float)
        Slopes (x, y) on the surface at which what holds the parts upright exerts no moment: caps
        were balanced against it already, and the map is pressed against it.

    Returns
    -------
    ContactState, CapTable
        The state under preload, and the table with its loads and contact radii. Both are NaN where
        the model has no caps.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload within the validity of the model.

    Notes
    -----
    Where a hardness is given, the curve is the one along which the face unloads after it was loaded
    to the preload once: approach, stiffness and slip are those of the caps that yielded, see
    `flattening`.
    """
    joint = composite(settings.material.youngs_modulus_Pa, settings.material.poisson_ratio)
    preload_N = settings.contact.preload_N
    use, reason, moved, problems = caps.usable, "chosen in the settings", None, []
    errors, choice, model_name = None, None, settings.contact.model
    if model_name == "auto":
        choice = choose_model(caps, families, surface, label, noise_m, settings, map_failure)
        use, reason, moved, model_name = choice.use, choice.reason, choice.moved, choice.model
        errors = choice.model_errors
        problems += [] if choice.problem is None else [choice.problem]
    model = rung(model_name)
    before = Scene.of(caps, families, surface, settings, use, at_ease_rad)
    scene = flattened(model, before)
    normal = _curve(model, scene, moved)
    approach_m = float(normal.approach_m(preload_N))
    found, a_m = _contacts(scene, caps, normal, approach_m, model)
    curve, bulk_m, bulk = normal, 0.0, settings.contact.bulk
    if model.holds_bulk:
        bulk_m_per_N = bulk_of_face_m_per_N(surface, joint.E_star_Pa)
        bulk_m, greatest = bulk_m_per_N * preload_N, greatest_over_mean(settings.slip)
        if not bulk:
            curve, bulk = without_bulk(normal, bulk_m_per_N, greatest * preload_N)
            problems += problems_of_bulk(bulk_m_per_N, curve, preload_N, greatest, kept=bulk)
    problems += problems_of_closing(found, surface.measured_area_m2)
    of_slip = () if model.problems is None else model.problems(normal, preload_N)
    if choice is not None and model.error is not None:
        errors, doubts = model.error(curve, preload_N, *asked_of_error(settings, scene.noise_m))
        better = choice.caps_within(of_map := _by_detail(errors, doubts))
        if better is not None:
            return _by_caps(better, doubts, of_map, (caps, families, surface), settings)
        problems += doubts
    state = ContactState(
        rung=model,
        model_reason=reason,
        errors=errors,
        moved=_found(moved, normal, curve),
        preload_N=preload_N,
        approach_m=approach_m,
        bulk_m=bulk_m,
        bulk=bulk,
        contacts=found.count,
        overlapping_pairs=found.overlapping_pairs,
        stiffness_N_per_m=float(curve.stiffness_N_per_m(curve.approach_m(preload_N))),
        contact_area_m2=found.area_m2,
        max_pressure_Pa=found.max_pressure_Pa,
        use=use & (model.made_from == "spheres"),
        row_family=found.family,
        normal=normal,
        curve=curve,
        composite=joint,
        load_point_m=scene.load_point_m,
        eccentricity_m=_eccentricity_m(found, scene),
        tilt_rad=found.tilt_rad,
        problems=(*problems, *of_slip),
        hardness_Pa=None if scene.law is None else scene.law.hardness_Pa,
        yielded_area_m2=found.yielded_area_m2,
        left_m=left_m(model, before, scene, normal),
        first=_first(model, before, normal, bulk),
        turned=_turned(model, before, normal, bulk),
        at_ease_rad=at_ease_rad,
    )
    return state, caps.with_columns(load_N=found.load_N, contact_radius_m=a_m)


def _ask_caps(doubts: tuple[Problem, ...]) -> bool:
    """Tell whether doubts about a pressed map are a reason to see whether its caps know better.

    Small forces are none, as caps that yield know less of them than pixels; nor is a blur of both.
    """
    none = ("small_slip_extrapolated", BLURRED)
    return any(one.severity != "info" for one in doubts if one.code not in none)


def _curve(model: Rung, scene: Scene, moved: MovedCaps | None) -> NormalCurve:
    """Return the curve of a model: that which the choice pressed, but of caps that yield."""
    known = None if moved is None or scene.law is not None else moved.whole
    if known is not None and known.model == model.name:
        return known
    built: NormalCurve = model.build(scene)
    return built


def _found(moved: MovedCaps | None, normal: NormalCurve, curve: NormalCurve) -> MovedCaps | None:
    """Return moved caps with the one curve for slip, which remembers what it was asked."""
    if moved is None or moved.whole is not normal:
        return moved
    return replace(moved, found=curve)


def _eccentricity_m(found: Contacts, scene: Scene) -> tuple[float, float] | None:
    """Return the place (x, y) of the resultant of the contacts, from the load point."""
    if found.resultant_m is None:
        return None
    x_m, y_m = np.subtract(found.resultant_m, scene.load_point_m).tolist()
    return x_m, y_m


def _by_detail(errors: ModelError | None, doubts: tuple[Problem, ...]) -> float:
    """Return the error of a map whose detail decides, 0 where it does not, or none is known.

    From a quarter of mu N on, as what is doubted, without that of its optics: caps leave as much.
    """
    if errors is None or not _ask_caps(doubts):
        return 0.0
    return errors.without_blur.greatest_at(ASKED)


def _by_caps(
    choice: Choice,
    doubts: tuple[Problem, ...],
    error_of_map: float,
    face: tuple[CapTable, Families, HeightMap],
    settings: Settings,
) -> tuple[ContactState, CapTable]:
    """Return the face pressed by caps, whose fits average over what decides on the map itself.

    What is said of the map is a note where caps are within the tolerance at all forces asked for:
    as of the map, what moves the energy at smaller ones alone is no warning.
    """
    forced = msgspec.structs.replace(settings.contact, model=choice.model)
    state, caps = press(*face, msgspec.structs.replace(settings, contact=forced))
    error, errors = choice.estimated_error, choice.errors_by_force
    assert error is not None  # see `Choice.caps_within`
    assert errors is not None
    asked = errors.greatest_at(ASKED)
    said = f"; so caps answer, which average over it and may be off by {percent(error)}"
    within = asked <= settings.contact.tolerance < error
    said += f", by no more than {percent(asked)} from {percent(ASKED)} of gross slip on" * within
    effect = Effect(error, error, error)
    problems = [
        replace(one, message=one.message + said, effect=effect, severity=_noted(one, within))
        for one in (one for one in doubts if one.code != BLURRED)
    ]
    reason = (
        f"{choice.why}, and by {percent(asked)} from {percent(ASKED)} of gross slip on, but the "
        f"map itself by {percent(error_of_map)} there, as its finest detail decides: caps average "
        "over it"
    )
    known = replace(state, errors=errors, moved=choice.moved)
    return replace(known, model_reason=reason, problems=(*problems, *state.problems)), caps


def _noted(doubt: Problem, within: bool) -> Severity:
    """Return how severe a doubt of the map is: a note where caps are within the tolerance."""
    return "info" if within and "info" in doubt.kind.severities else doubt.severity


def _first(
    model: Rung, scene: Scene, normal: NormalCurve, bulk: bool
) -> Callable[[float, float], NormalCurve] | None:
    if scene.law is None or model.made_from == "nothing":
        return None
    known = {scene.preload_N: normal}
    # Answer and band ask twice
    return cache(partial(loaded_first, model, scene, known, bulk))


def _turned(
    model: Rung, scene: Scene, normal: NormalCurve, bulk: bool
) -> Callable[[float], NormalCurve] | None:
    if model.after is None or scene.turning_stiffness > 0.0:
        return None
    known = {scene.preload_N: normal}
    return cache(partial(loaded_first, model, scene, known, bulk, place_m=scene.load_point_m))


def _contacts(
    scene: Scene, caps: CapTable, curve: NormalCurve, approach_m: float, model: Rung
) -> tuple[Contacts, np.ndarray]:
    """Return the contacts under the preload and their radii, of `caps` as they were before it.

    Refuses contacts of more area than the face has.
    """
    found, law, radius_m = model.contacts(scene, curve, approach_m), scene.law, caps.radius_m
    face_m2 = float(scene.surface.n_measured) * scene.surface.pixel_area_m2
    as_it_lies = f"as the face lies; expected less than the {face_m2:.3g} m2 measured of it"
    refuse_more_than_all(model, scene.preload_N, found, face_m2, as_it_lies)
    yielded = np.zeros(len(caps), dtype=bool)
    if law is not None:
        yielded = law.yielded(found.load_N, radius_m)
        radius_m, _ = law.flattened(found.load_N, radius_m)
    a_m = contact_radius_m(found.load_N, radius_m, scene.E_star_Pa)
    if law is None or found.area_m2 is None or found.max_pressure_Pa is None:
        return found, a_m
    if model.made_from == "spheres":  # a Hertz contact of that load and width has a sharper middle
        area_m2 = min(found.area_m2, float(np.pi * np.square(a_m[yielded]).sum()))
        pressure_Pa = min(found.max_pressure_Pa, law.hardness_Pa)
        found = replace(found, yielded_area_m2=area_m2, max_pressure_Pa=pressure_Pa)
    return found, a_m


def refuse_more_than_all(
    model: Rung, preload_N: float, found: Contacts, face_m2: float, expected: str
) -> None:
    """Refuse contacts of more area than the face has.

    Raises
    ------
    ContactError
        If no gap is left; it says what was expected.
    """
    touching_m2 = found.area_m2
    if touching_m2 is not None and touching_m2 > FULL * face_m2:
        raise ContactError(
            f"{model.name}: {preload_N:g} N need a contact area of {touching_m2:.3g} m2 {expected}"
        )


def problems_of_closing(found: Contacts, face_m2: float) -> list[Problem]:
    """Return whether more of the face touches than tops of its waviness would."""
    share = 0.0 if found.area_m2 is None else found.area_m2 / face_m2
    if share <= CLOSING:
        return []
    message = (
        f"{share:.0%} of the face touches under {found.count} contacts: it closes rather than "
        "rests on its tops, as under far too great a load or with heights or pixels in a wrong unit"
    )
    return [Problem("face_closes", "warning", message)]
