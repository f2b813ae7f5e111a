"""What the other modules know of a contact model: a rung of the ladder from cheap to exact.

A rung is one file in `contact/models` that holds a `Rung` named `RUNG` under the file's own name.
No other module asks for the name of a rung; whatever sets one apart is an attribute here.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar, cast

import numpy as np

from capslip import registry
from capslip.caps.families import Families
from capslip.caps.table import CapTable
from capslip.contact.curve import AsperityCurve, NormalCurve
from capslip.contact.material import composite, yield_law
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.contact.solvers.yielding import YieldLaw
from capslip.errors import SettingsError, one_of
from capslip.problems import Problem
from capslip.settings import Settings
from capslip.surface.heightmap import HeightMap
from capslip.surface.noise import known_noise_m

if TYPE_CHECKING:
    from capslip.contact.plastic_law import LawError
    from capslip.contact.press import ContactState

FOLDER = "contact.models"
C = TypeVar("C", bound=NormalCurve)
MAX_PAIRS = 2000  # caps; more are pressed without interaction to find the level


@dataclass(frozen=True, eq=False)
class Scene:
    """What a rung may build its curve from."""

    caps: CapTable  # (n,), at least one of them usable
    families: Families
    surface: HeightMap  # after removal of the form
    E_star_Pa: float
    preload_N: float
    use: np.ndarray  # (n,), the caps to take, the highest usable one among them
    solver_tolerance: float  # relative to the approach, for a rung that iterates on the map
    load_point_m: tuple[float, float]  # place (x, y) of the line of action
    turning_stiffness: float  # N m/rad against a tilt; inf: the face stays as levelled
    law: YieldLaw | None = None  # of caps that yield; None: all stays elastic
    start_m: np.ndarray | None = None  # compressions of the caps in use, where they are known
    time_limit_s: float = math.inf  # of a rung that iterates on the map
    at_ease_rad: tuple[float, float] = (0.0, 0.0)  # slopes on the surface without a moment
    noise_m: float | None = None  # of the instrument, where it is known

    @classmethod
    def of(
        cls,
        caps: CapTable,
        families: Families,
        surface: HeightMap,
        settings: Settings,
        use: np.ndarray,
        at_ease_rad: tuple[float, float] = (0.0, 0.0),
    ) -> "Scene":
        """Return the scene under the preload of the settings."""
        material, contact = settings.material, settings.contact
        return cls(
            *(caps, families, surface),
            composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa,
            contact.preload_N,
            use,
            contact.solver_tolerance,
            load_point_m(surface, settings),
            turning_stiffness(settings),
            yield_law(material),
            time_limit_s=contact.time_limit_s,
            at_ease_rad=at_ease_rad,
            noise_m=known_noise_m(surface, settings),
        )

    @property
    def radius_m(self) -> np.ndarray:
        """Radii of the caps in use."""
        return self.caps.radius_m[self.use]

    @property
    def depth_m(self) -> np.ndarray:
        """How far the caps in use lie below the highest of them."""
        peak_height_m = self.caps.peak_height_m[self.use]
        return peak_height_m.max() - peak_height_m


@dataclass(frozen=True, eq=False)
class Contacts:
    """What a rung knows of the single contacts under the preload; None where it knows nothing."""

    count: int
    load_N: np.ndarray  # (n,), of each cap; NaN where the caps are no contacts
    family: np.ndarray  # "G", "P" or "" for each row of the curve, for its limits of slip
    area_m2: float | None = None
    yielded_area_m2: float | None = None  # of that, where the material has yielded
    max_pressure_Pa: float | None = None
    overlapping_pairs: int = 0  # where there are any, the caps do not hold
    resultant_m: tuple[float, float] | None = None  # place (x, y) of the resultant
    tilt_rad: tuple[float, float] = (0.0, 0.0)  # that the rung itself added to the map


@dataclass(frozen=True)
class ModelError:
    """Relative errors that a model expects of itself, at 95 %."""

    stiffness: float  # where slip begins, and of the secants
    energy: float  # the greatest from a tenth of mu N on
    # Shares of mu N, growing, and the error of the energy at each, where it falls with the force
    energy_by_share: tuple[tuple[float, float], ...] = ()
    unknown_to: float = 0.0  # share of mu N, up to which the energy is anything in its rectangle
    law: "LawError | None" = None  # of a map that yields: what that leaves open beside all this
    blur: tuple[float, float] = (0.0, 0.0)  # what the optics leave of stiffness and energy in these
    # What there is to say of them where a share of mu N is asked for; None: the same at any force
    doubts_at: Callable[[float], tuple[Problem, ...]] | None = field(
        default=None, compare=False, repr=False
    )

    @classmethod
    def of_either(cls, error: float | None) -> "ModelError | None":
        """Return one error that holds for both; None where it is not known."""
        return None if error is None else cls(error, error)

    @property
    def greatest(self) -> float:
        """The greater of both, from a tenth of mu N on."""
        return max(self.stiffness, self.energy)

    @property
    def without_blur(self) -> "ModelError":
        """The errors less what the optics leave, which no other model of the same scan escapes."""
        of_stiffness, of_energy = self.blur

        def less(error: float, blur: float) -> float:
            return math.sqrt(max(error**2 - blur**2, 0.0))

        by_share = tuple((at, less(error, of_energy)) for at, error in self.energy_by_share)
        stiffness, energy = less(self.stiffness, of_stiffness), less(self.energy, of_energy)
        return replace(
            self, stiffness=stiffness, energy=energy, energy_by_share=by_share, blur=(0.0, 0.0)
        )

    def greatest_at(self, share: float) -> float:
        """Return the greater of the errors of stiffness and of the energy at a share of mu N."""
        return max(self.both_at(share))

    def both_at(self, share: float) -> tuple[float, float]:
        """Return the errors of stiffness and of the energy at a share of mu N."""
        return self.stiffness, self.energy_at(share)

    def energy_at(self, share: float) -> float:
        """Return the error of the energy at a share of mu N, a power between those known.

        Below the least of these it grows as the share falls: what slips of a contact is a ring, and
        as wide as that share of it.
        """
        if not self.energy_by_share:
            return self.energy
        known = np.log(np.array(self.energy_by_share).T)
        beyond = max(self.energy_by_share[0][0] / share, 1.0)
        return beyond * math.exp(float(np.interp(math.log(share), *known)))


@dataclass(frozen=True, eq=False)
class Rung(Generic[C]):
    """One contact model, C the kind of its curve."""

    name: str  # of its file, and in the settings
    label: str  # in figures and text
    cost: float  # order on the ladder, cheapest first
    made_from: Literal["nothing", "spheres", "map"]  # what the curve takes of the face
    automatic: bool  # whether the automatic choice may take it
    holds_bulk: bool  # whether the curve holds the bulk sinking of the half-space
    leaves_out: str  # one sentence
    colour: str  # after Okabe and Ito
    build: Callable[[Scene], C]
    contacts: Callable[[Scene, C, float], Contacts]  # at the approach under the preload
    doubt: str | None = None  # what makes any result of it doubtful
    contact_name: str = "caps in contact"  # what `Contacts.count` counts
    # How many contacts there are under a load; None: it knows none
    touching: Callable[[C, float], int] | None = None
    # Growing loads up to one whose approach costs no solution; None: any load is as good
    solved_loads_N: Callable[[C, float], np.ndarray] | None = None
    reads_families: bool = False  # whether it takes m, n, R and h, not each cap for itself
    knows_places: bool = True  # whether a tilt moves its contacts; else it stays as levelled
    # The error to be expected at a load, and what takes it beyond a tolerance, where it knows both
    # (curve, load, tolerance, measurement noise, whether an S-filter is set, lateral period limit)
    error: (
        Callable[
            [C, float, float, float | None, bool, float | None],
            tuple[ModelError | None, tuple[Problem, ...]],
        ]
        | None
    ) = None
    # What is doubtful of slip below a load, where the rung looks at that
    problems: Callable[[C, float], tuple[Problem, ...]] | None = None
    # Share of the force at total slip below which the energy at a load is not resolved
    least_share: Callable[[C, float], float] | None = None
    # What pixels leave in the energy at a load, by shares of mu N, relative, at 95 %
    left_by_pixels: Callable[[C, float], dict[float, float]] | None = None
    interacts: bool = False  # whether each contact sinks the others
    # How shear is shared before any slip at a load, and what partial slip adds until only a share
    # of the load sticks, as maps of any unit; None: its contacts are caps
    tractions: Callable[[C, float, float], tuple[np.ndarray, np.ndarray]] | None = None
    # Curves after other first loadings than that to a load, by factors on it and on the
    # hardness, good about the withdrawal of a share of the load; None: each is built anew
    near: Callable[[C, float, Sequence[tuple[float, float]], float], list[NormalCurve]] | None = (
        None
    )
    # The curve after another first loading than that to a load, by factors on it and on the
    # hardness, at its tilt or at the one that lets the load act at a place; None: it is built anew
    after: Callable[[C, float, float, float, tuple[float, float] | None], C] | None = None
    # The same curve, followed at these shares of mu N alone, for less; None: any is as good
    at_forces: Callable[[C, tuple[float, ...]], C] | None = None
    # Loads of its rows under a load, of caps that sink each other; None: each goes down alone
    coupled_loads_N: Callable[[C, float], np.ndarray] | None = None


def load_point_m(surface: HeightMap, settings: Settings) -> tuple[float, float]:
    """Return the place (x, y) of the line of action: as set, or the centre of what was measured.

    An even pressure on the rectangle that it acts on has its resultant there, see `joint_of`.
    """
    if settings.contact.load_point_m is not None:
        return settings.contact.load_point_m
    return surface.centre_m


def resolved_share(contact: "ContactState") -> float:
    """Return the share of gross slip below which the pixels of a map resolve no slip; or zero."""
    share_of = contact.rung.least_share
    return 0.0 if share_of is None else float(share_of(contact.normal, contact.preload_N))


def asked_of_error(
    settings: Settings, noise_m: float | None
) -> tuple[float, float | None, bool, float | None]:
    """Return what the error of a rung is asked with, after its curve and the load."""
    filtered = settings.conditioning.s_filter_nesting_index_m is not None
    period_m = settings.instrument.lateral_period_limit_m
    return settings.contact.tolerance, noise_m, filtered, period_m


def turning_stiffness(settings: Settings) -> float:
    """Return what holds the face against a tilt, in N m/rad; infinite as levelled."""
    contact = settings.contact
    balanced = contact.alignment == "balanced"
    return contact.alignment_stiffness_Nm_per_rad if balanced else math.inf


def pairs_in_balance(arm_m: np.ndarray, E_star_Pa: float, settings: Settings) -> np.ndarray | None:
    """Return the compliances between caps as they are balanced, in m/N.

    None where the model has none between them, and where there are too many pairs.

    Parameters
    ----------
    arm_m : float64, shape (n, 2)
        Places (x, y).
    E_star_Pa : float
        Composite modulus.
    settings : Settings
        `contact`, with the model.
    """
    model = settings.contact.model
    if len(arm_m) > MAX_PAIRS or not (model == "auto" or rung(model).interacts):
        return None
    x_m, y_m = arm_m.T
    between = np.square(x_m[:, None] - x_m)  # r^2, and all else in its place: pairs are many
    between += np.square(y_m[:, None] - y_m)
    np.fill_diagonal(between, np.inf)
    np.sqrt(between, out=between)
    return np.divide(1.0 / (math.pi * E_star_Pa), between, out=between)


def rung(name: str) -> Rung[Any]:
    """Return the rung of that name; SettingsError where there is none."""
    try:
        return cast(Rung[Any], registry.entry(FOLDER, name).RUNG)
    except KeyError:
        known = one_of(registry.names(FOLDER), name)
        raise SettingsError(f"contact.model: got {name!r}; {known}") from None


def made_from(settings: Settings) -> str:
    """Return what the contact model takes of the face; spheres where it is chosen later."""
    model = settings.contact.model
    return "spheres" if model == "auto" else rung(model).made_from


def ladder() -> tuple[Rung[Any], ...]:
    """Return all rungs, the cheapest first.

    Examples
    --------
    >>> [rung.name for rung in ladder() if rung.automatic]
    ['families', 'caps', 'mean_field', 'interacting']
    """
    return tuple(sorted(map(rung, registry.names(FOLDER)), key=lambda one: one.cost))


def contacts_of_caps(
    scene: Scene, curve: AsperityCurve, approach_m: float, overlapping_pairs: int = 0
) -> Contacts:
    """Return the contacts of a curve whose rows are the caps in use."""
    one_N = curve.asperity_loads_N(approach_m)
    load_N = np.where(scene.caps.usable, 0.0, np.nan)
    load_N[scene.use] = one_N
    family = scene.caps.family[scene.use]
    places = scene.caps.x_m[scene.use], scene.caps.y_m[scene.use]
    found = contacts_of_rows(scene.E_star_Pa, curve, one_N, load_N, family, overlapping_pairs)
    x_m, y_m = (float(one_N @ at_m / one_N.sum()) for at_m in places)
    return replace(found, resultant_m=(x_m, y_m))


def touching_caps(curve: AsperityCurve, load_N: float) -> int:
    """Return how many asperities of a curve touch under a load."""
    return int(curve.count[curve.asperity_loads_N(curve.approach_m(load_N)) > 0.0].sum())


def contacts_of_rows(
    E_star_Pa: float,
    curve: AsperityCurve,
    row_load_N: np.ndarray,
    load_N: np.ndarray,
    family: np.ndarray,
    overlapping_pairs: int = 0,
) -> Contacts:
    """Return the contacts of a curve whose rows are equal spheres under `row_load_N` each."""
    touching = row_load_N > 0.0
    a_m = contact_radius_m(row_load_N, curve.radius_m, E_star_Pa)
    pressure_Pa = 1.5 * row_load_N[touching] / (np.pi * a_m[touching] ** 2)
    return Contacts(
        count=int(curve.count[touching].sum()),
        load_N=load_N,
        family=family,
        area_m2=float((curve.count * np.pi * a_m**2).sum()),
        max_pressure_Pa=float(pressure_Pa.max()),
        overlapping_pairs=overlapping_pairs,
    )
