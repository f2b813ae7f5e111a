"""Settings: strict, frozen, SI, with the unit in every name.

A settings file is TOML. Every key has a default, so a file names only what differs. An unknown key,
a wrong type or a value out of bounds is an error, with a proposal where one has a like name. The
classes take anything: what is given settings has them `checked` first.
"""

import hashlib
import math
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from capslip import registry
from capslip.errors import SettingsError, check_kind, one_of, path_of, texts_of
from capslip.materials import refuse_stray_spread, with_preset, without_said
from capslip.setting_errors import GREATEST, LEAST, converted, meant, plain, refuse_unknown
from capslip.units import LengthUnit, as_named

MOST = 10**9  # of anything that is counted
Positive = Annotated[float, msgspec.Meta(ge=LEAST, le=GREATEST)]
Share = Annotated[float, msgspec.Meta(gt=0, lt=1)]
Pair = tuple[float, float]
PoissonRatio = Annotated[float, msgspec.Meta(gt=-1, lt=0.5)]
Count = Annotated[int, msgspec.Meta(ge=1, le=MOST)]
Size = Annotated[int, msgspec.Meta(ge=3, le=MOST)]
Angle = Annotated[float, msgspec.Meta(ge=-2.0 * math.pi, le=2.0 * math.pi)]  # degrees are more
SOLVER_TOLERANCE = (1e-10, 1e-3)  # least and greatest, of boundary elements
# What nobody may have given: a default that stands in for it is no fact of this joint
STAND_INS = (
    "contact.preload_N",
    "material.youngs_modulus_Pa",
    "material.poisson_ratio",
    "material.friction_coefficient",
    "structure.beam",
)
OF_A_MATERIAL = {"material.youngs_modulus_Pa", "material.poisson_ratio"}  # that has a name
Spread = Annotated[float, msgspec.Meta(ge=0, lt=1)]  # relative, at 95 %; 0: not varied
SolverTolerance = Annotated[float, msgspec.Meta(ge=SOLVER_TOLERANCE[0], le=SOLVER_TOLERANCE[1])]


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a settings file."""


class Reading(_Table, frozen=True):
    """What a file does not say of itself. Never overrides what it says."""

    unit: LengthUnit | None = None
    lateral_unit: LengthUnit | None = None
    pixel_size: tuple[Positive, Positive] | None = None  # (dy, dx) in lateral_unit
    dataset: str | None = None
    scale: Positive | None = None  # heights in `unit` a stored number
    top_row_first: bool | None = None  # y falls with the row, as in a picture
    invert: bool = False  # gaps or depths in place of heights
    lenient: bool = False  # accept odd X3P archives, each with a note


class Instrument(_Table, frozen=True):
    """What is known of the instrument, in the words of ISO 25178-600."""

    flatness_deviation_m: Positive | None = None  # z_FLT, of the map of a flat
    noise_m: Positive | None = None  # N_M, rms of a height of one scan, before filters
    lateral_period_limit_m: Positive | None = None  # D_LIM, of the wave that it halves


class Conditioning(_Table, frozen=True):
    """From the raw height map to the one that is cut."""

    form: Literal["plane", "quadratic", "polynomial", "cylinder", "sphere", "none"] = "plane"
    form_degree: Annotated[int, msgspec.Meta(ge=1, le=10)] | None = None  # of a polynomial
    form_robust: bool = False
    form_floor: bool = False
    outliers: Literal["isolated", "none"] = "isolated"
    edge_trim_m: Positive | None = None
    s_filter_nesting_index_m: Positive | None = None
    l_filter_nesting_index_m: Positive | None = None
    resample_to: tuple[Size, Size] | None = None  # points (ny, nx)


class Mating(_Table, frozen=True):
    """How a second face is laid on the first, where there is one."""

    way: Literal["composite", "together"] = "composite"
    align: Literal["given", "least_squares"] = "given"
    mirror: Literal["x", "y"] = "x"
    offset_m: Pair = (0.0, 0.0)
    rotation_rad: Angle = 0.0


class HillSettings(_Table, frozen=True):
    """The cut, and what counts as a hill."""

    material_ratio: Share = 0.10
    cut: Literal["certified", "fixed"] = "certified"  # grown until it holds all that touches
    separation: Literal["watershed", "regions"] = "watershed"
    pruning_height_m: Positive | None = None
    pruning_percent_Sz: Annotated[float, msgspec.Meta(gt=0, lt=100)] | None = None


class CapSettings(_Table, frozen=True):
    """How a sphere is fitted to a hill."""

    fit: str = "contact"  # one of the files of capslip.caps.fits


class FamilySettings(_Table, frozen=True):
    """How many families the caps are grouped into."""

    count: Literal["auto", 1, 2] = "auto"
    feature: Literal["peak_height", "cap_height", "diameter", "radius"] = "peak_height"
    # Given in place of a scan
    m: Count | None = None
    n: Annotated[int, msgspec.Meta(ge=0, le=MOST)] | None = None
    radius_G_m: Positive | None = None
    radius_P_m: Positive | None = None
    h_m: Annotated[float, msgspec.Meta(ge=0, le=GREATEST)] | None = None
    approach_m: Positive | None = None  # in place of the preload


class Material(_Table, frozen=True):
    """The two bodies and the friction between them.

    Hardness and yield stress are those of the softer body: it yields, and the other one does not.
    """

    preset: str | tuple[str, str] | None = None  # of capslip.materials; fills in what is not given
    values_of: str | tuple[str, str] | None = None  # the preset that filled in; nobody gives it
    youngs_modulus_Pa: tuple[Positive, Positive] = (200e9, 200e9)
    poisson_ratio: tuple[PoissonRatio, PoissonRatio] = (0.3, 0.3)
    friction_coefficient: Positive = 0.2
    hardness_Pa: Positive | None = None
    yield_stress_Pa: Positive | None = None  # gives the hardness where that is not given
    modulus_spread: Spread = 0.0
    friction_spread: Spread = 0.0
    hardness_spread: Spread = 0.0


class Contact(_Table, frozen=True):
    """The contact model and the preload of one joint."""

    model: str = "auto"  # or the name of a rung: a file in contact/models
    preload_N: Positive = 460.0
    nominal_pressure_Pa: Positive | None = None  # of the joint, in place of the preload
    preload_spread: Spread = 0.0
    alignment: Literal["balanced", "as_levelled"] = "balanced"
    load_point_m: Pair | None = None  # (x, y) of its line; default: centre of what was measured
    alignment_stiffness_Nm_per_rad: Annotated[float, msgspec.Meta(ge=0, le=GREATEST)] = 0.0
    tolerance: Annotated[float, msgspec.Meta(ge=1e-6, lt=1)] = 0.05
    time_limit_s: Positive = 60.0  # of the processor, for boundary elements
    solver_tolerance: SolverTolerance = 1e-7  # of boundary elements
    bulk: bool = False  # keep the half-space's bulk sinking in stiffness and displacement


class JointSettings(_Table, frozen=True):
    """The joint that the scan is a part of; without any of these it is the scan."""

    area_m2: Positive | None = None
    pressure_map: str | None = None  # CSV, see contact/pressure_map.py
    non_measured: Literal["unknown", "void"] = "unknown"  # void: no material, as in a bolt hole


class Beam(_Table, frozen=True):
    """A clamped-clamped beam with joints across its section."""

    length_m: Positive = 0.4
    width_m: Positive = 0.06
    thickness_m: Positive = 0.04
    density_kg_per_m3: Positive = 7850.0
    theory: Literal["timoshenko", "euler_bernoulli"] = "timoshenko"
    joint_position_m: Positive | None = None  # default: where the bending moment vanishes


class Structure(_Table, frozen=True):
    """The vibrating structure: two stiffnesses, or a beam that gives them."""

    modal_stiffness_N_per_m: Positive | None = None
    joint_stiffness_N_per_m: Positive | None = None
    joints: Count = 2
    beam: Beam = Beam()


class SlipSettings(_Table, frozen=True):
    """Where the joint slips to and fro, and how the normal load goes while it does."""

    direction_rad: Angle | None = None  # from x towards y; None: the mean over all directions
    normal_amplitude_ratio: Annotated[float, msgspec.Meta(ge=0, le=0.9)] = 0.0  # to the preload
    normal_phase_rad: Angle = 0.0  # by which it lags the tangential force


class Question(_Table, frozen=True):
    """What is asked: one of these, or none; then a quarter of the force at gross slip."""

    amplitude_m: Positive | None = None  # of the structure with rigid joints, where K_m is
    slip_force_N: Positive | None = None  # tangential, of one joint
    displacement_m: Positive | None = None  # tangential, of one joint


class Cluster(_Table, frozen=True):
    """Jobs of a batch system that do a batch, in place of processes of this machine."""

    system: Literal["slurm", "pbs"] | None = None
    jobs: Count = 1
    processes: Count = 8  # of each job, one a core
    memory_GB: Positive = 16.0  # of each job
    time_s: Positive = 14400.0
    directives: tuple[str, ...] = ()  # other lines of the job script, such as "-A project"


class Run(_Table, frozen=True):
    """What changes no number."""

    workers: Annotated[int, msgspec.Meta(ge=0, le=MOST)] = 0  # 0: one a core
    sensitivity: bool = False  # sweep cut, pruning, filter and level around what was chosen
    figures: bool = True
    render: bool = True
    meshes: bool = True  # `caps.vtu` and `surface.vtu`
    cluster: Cluster = Cluster()
    given: tuple[str, ...] = ()  # the STAND_INS that a file or an option gave


class Settings(_Table, frozen=True):
    """All settings of one analysis.

    Examples
    --------
    >>> Settings(contact=Contact(preload_N=800.0)).contact.preload_N
    800.0
    """

    reading: Reading = Reading()
    instrument: Instrument = Instrument()
    conditioning: Conditioning = Conditioning()
    mating: Mating = Mating()
    hills: HillSettings = HillSettings()
    caps: CapSettings = CapSettings()
    families: FamilySettings = FamilySettings()
    material: Material = Material()
    contact: Contact = Contact()
    joint: JointSettings = JointSettings()
    slip: SlipSettings = SlipSettings()
    structure: Structure = Structure()
    answer: Question = Question()
    run: Run = Run()

    def to_dict(self) -> dict[str, Any]:
        """Return plain nested dictionaries; settings that are absent are left out."""
        tables: dict[str, Any] = _without_none(msgspec.to_builtins(self))
        instead = self.contact.nominal_pressure_Pa, self.joint.pressure_map
        if any(one is not None for one in (*instead, self.families.approach_m)):
            del tables["contact"]["preload_N"]  # it follows
        return tables

    def is_given(self, stand_in: str) -> bool:
        """Return whether someone gave one of the `STAND_INS`: said so, or gave another value."""
        table, key = stand_in.split(".")
        mine, default = (getattr(getattr(one, table), key) for one in (self, Settings()))
        return stand_in in self.run.given or mine != default

    def sha256(self) -> str:
        """Return the digest of everything that can change a result, so without most of `[run]`."""
        tables = self.to_dict()
        tables["run"] = {"given": self.run.given}
        if (path := self.joint.pressure_map) and Path(path).is_file():  # what it says counts
            tables["joint"]["pressure_map"] = hashlib.sha256(Path(path).read_bytes()).hexdigest()
        return hashlib.sha256(msgspec.json.encode(tables, order="deterministic")).hexdigest()


def load_settings(path: str | Path | None = None, overrides: Iterable[str] = ()) -> Settings:
    """Read a settings file and apply `table.key=value` overrides.

    Parameters
    ----------
    path : path, optional
        A TOML file; without it every setting has its default. The pressure map that it names lies
        beside it, unless its path is absolute; that of an override is seen from the current folder.
    overrides : sequence of str
        Each `table.key=value`, the value in TOML (a bare word, in a list too, is a text). Where
        one names a material, moduli, yield stress and hardness of the file give way to it.

    Raises
    ------
    SettingsError
        If the path is none, or overrides are no list of texts, the file cannot be read, a key is
        unknown, or a value has the wrong type or is out of bounds. The message names the key and,
        for a misspelt one, the closest that exists.

    Examples
    --------
    >>> load_settings(overrides=("contact.preload_N=230",)).contact.preload_N
    230.0
    """
    overrides = texts_of("overrides", overrides)
    tables: dict[str, Any] = {}
    if path is not None:
        try:
            tables = tomllib.loads(path_of("path", path).read_text(encoding="utf-8-sig"))
        except OSError as error:
            what = f"{error.strerror}; give a TOML file"
            raise SettingsError(f"settings file {path}: {what}") from error
        except ValueError as error:  # no UTF-8, no TOML, or a number of thousands of digits
            raise SettingsError(f"settings file {path}: not valid TOML: {error}") from error
        tables = _seen_from(Path(path).parent, tables)
    said: dict[str, Any] = {}
    for override in overrides:
        _apply(said, override)
    if "preset" in said.get("material", {}):
        tables = without_said(tables)
    for override in overrides:
        _apply(tables, override)
    written = tables.get("run", {}).get("given") if isinstance(tables.get("run"), dict) else None
    if isinstance(written, list):  # by an analysis, in a file that holds every value
        tables["run"]["given"] = [*written, *_given(with_preset(said))]
    return settings_from(tables, str(path) if path else "settings")


def settings_from(tables: dict[str, Any], where: str = "settings") -> Settings:
    """Check nested dictionaries and make them Settings; errors as for `load_settings`."""
    check_kind(where, tables, dict, "nested dictionaries")
    tables = _seen_from(Path(), plain(tables, where))
    refuse_unknown(tables, Settings, where)
    tables = with_preset(tables, where)
    settings = converted(tables, Settings, where)
    _check_meaning(settings, where)
    _check_load(tables, where)
    refuse_stray_spread(tables, where)
    given = set(settings.run.given) if "given" in tables.get("run", {}) else _given(tables)
    given |= OF_A_MATERIAL if settings.material.preset is not None else set()
    in_order = tuple(name for name in STAND_INS if name in given)
    run = msgspec.structs.replace(settings.run, given=in_order)
    return msgspec.structs.replace(settings, run=run)


def checked(settings: Settings) -> Settings:
    """Return settings as `load_settings` makes them, however they were made: by their classes, too.

    What was given in the type of a list, a dictionary or a number of NumPy has its own then, and a
    material that is named fills in the moduli and the yield stress that nobody gave: those that are
    the default.

    Raises
    ------
    SettingsError
        As for `load_settings`, or if they are no Settings.

    Examples
    --------
    >>> checked(Settings(material=Material(preset="aluminium"))).material.youngs_modulus_Pa
    (70000000000.0, 70000000000.0)
    >>> checked(Settings(contact=Contact(preload_N=-1.0)))
    Traceback (most recent call last):
    capslip.errors.SettingsError: settings: contact.preload_N: got -1.0; expected a number > 0
    """
    check_kind("settings", settings, Settings, "Settings; make them with capslip.load_settings")
    tables = plain(settings, "settings")
    refuse_unknown(tables, Settings, "settings")
    typed = converted(tables, Settings, "settings")
    tables = _without_none(msgspec.to_builtins(typed))
    given = [name for name in STAND_INS if typed.is_given(name)]
    if typed.material.preset is not None and typed.material.values_of is None:  # a new material
        made = Settings(material=typed.material)
        given = [name for name in given if name not in OF_A_MATERIAL or made.is_given(name)]
    tables["run"]["given"] = given
    for name in set(STAND_INS) - set(given):  # it stands aside for what is
        table, key = name.split(".")
        del tables[table][key]
    return settings_from(tables)


def _seen_from(folder: Path, tables: dict[str, Any]) -> dict[str, Any]:
    """Return nested dictionaries whose pressure map, seen from a folder, is found from anywhere."""
    joint = tables.get("joint")
    named = joint.get("pressure_map") if isinstance(joint, dict) else None
    if not isinstance(named, str) or not named:
        return tables
    place = str((folder / named).absolute())
    return {**tables, "joint": {**tables["joint"], "pressure_map": place}}


def _given(tables: dict[str, Any]) -> set[str]:
    """Return the stand-ins that nested dictionaries hold; an empty table is none."""
    pairs = (name.split(".") for name in STAND_INS)
    return {
        f"{table}.{key}"
        for table, key in pairs
        if isinstance(tables.get(table), dict) and tables[table].get(key, {}) != {}
    }


def _check_load(tables: dict[str, Any], where: str) -> None:
    """Refuse what gives the load or the area of the joint twice."""
    contact, joint = tables.get("contact", {}), tables.get("joint", {})
    loads = [f"contact.{key}" for key in ("preload_N", "nominal_pressure_Pa") if key in contact]
    loads += ["families.approach_m"] if "approach_m" in tables.get("families", {}) else []
    if "pressure_map" in joint:
        loads += ["joint.pressure_map"]
        loads += ["joint.area_m2"] if "area_m2" in joint else []
    if len(loads) > 1:
        raise SettingsError(
            f"{where}: got {' and '.join(loads)}; each says how much load or area the joint has; "
            "expected one of them"
        )


def _check_meaning(settings: Settings, where: str) -> None:
    for name, got, known in (
        ("caps.fit", settings.caps.fit, registry.names("caps.fits")),
        ("contact.model", settings.contact.model, ("auto", *registry.names("contact.models"))),
    ):
        if got not in known:
            raise SettingsError(f"{where}: {name}: got {got!r}; {one_of(known, got)}")
    filters = settings.conditioning
    short_m, long_m = filters.s_filter_nesting_index_m, filters.l_filter_nesting_index_m
    if short_m is not None and long_m is not None and short_m >= long_m:
        raise SettingsError(
            f"{where}: conditioning: s_filter_nesting_index_m {short_m:g} is not below "
            f"l_filter_nesting_index_m {long_m:g}; the first takes off what is shorter, the second "
            "what is longer, so nothing would be left"
        )
    hills = settings.hills
    if hills.pruning_height_m is not None and hills.pruning_percent_Sz is not None:
        raise SettingsError(
            f"{where}: hills: got pruning_height_m and pruning_percent_Sz; expected one or none"
        )
    _refuse_idle(settings, where)
    question = _without_none(msgspec.to_builtins(settings.answer))
    if len(question) > 1:
        raise SettingsError(
            f"{where}: answer: got {' and '.join(question)}; expected one question, or none"
        )
    structure = settings.structure
    if (structure.modal_stiffness_N_per_m is None) != (structure.joint_stiffness_N_per_m is None):
        raise SettingsError(
            f"{where}: structure: modal_stiffness_N_per_m and joint_stiffness_N_per_m go together; "
            "got one of them; expected both, or neither and a [structure.beam]"
        )


def _refuse_idle(settings: Settings, where: str) -> None:
    """Refuse settings that would do nothing beside another one: someone expects them to."""
    form, hills, contact = settings.conditioning, settings.hills, settings.contact
    fits = [name for name in ("form_robust", "form_floor") if getattr(form, name)]
    prunings = [
        name
        for name in ("pruning_height_m", "pruning_percent_Sz")
        if getattr(hills, name) is not None
    ]
    held = contact.alignment_stiffness_Nm_per_rad > 0.0 and contact.alignment == "as_levelled"
    wrong: tuple[tuple[bool, str, str], ...] = (
        (len(fits) > 1, "conditioning: got form_robust and form_floor", "one fit or the other"),
        (
            hills.separation == "regions" and bool(prunings),
            f"hills: got {', '.join(prunings)} with separation = regions, which prunes nothing",
            "separation = watershed, or no pruning",
        ),
        (
            held,
            "contact: got alignment_stiffness_Nm_per_rad with alignment = as_levelled, which lets "
            "nothing turn",
            "alignment = balanced, or no such stiffness",
        ),
    )
    for is_wrong, got, expected in wrong:
        if is_wrong:
            raise SettingsError(f"{where}: {got}; expected {expected}")


def _apply(tables: dict[str, Any], override: str) -> None:
    """Set one value in nested dictionaries."""
    name, equals, text = override.partition("=")
    keys = name.strip().split(".")
    if not equals or not all(keys) or len(keys) < 2:
        mean = meant(name.strip(), Settings)
        raise SettingsError(f"--set {override}: expected table.key=value{mean}")
    for key in keys[:-1]:
        tables = tables.setdefault(key, {})
        if not isinstance(tables, dict):
            raise SettingsError(f"--set {override}: {key} is no table")
    tables[keys[-1]] = as_named(_value(text.strip()), keys[-1])


def _value(text: str) -> Any:
    """Return a value in TOML; bare words are texts, those of a list as well."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except ValueError:  # a number of thousands of digits, too
        listed = text.startswith("[") and text.endswith("]")
        return [_value(word.strip()) for word in text[1:-1].split(",")] if listed else text


def _without_none(table: dict[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, dict) else value
        for key, value in table.items()
        if value is not None
    }
