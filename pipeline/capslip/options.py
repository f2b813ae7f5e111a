"""Options of the command line, and the settings that they stand for."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from capslip import registry
from capslip.errors import SettingsError
from capslip.materials import MATERIALS
from capslip.units import WORDS, SiUnit, in_si

if TYPE_CHECKING:
    from capslip.settings import Settings

MODELS = ("auto", *registry.names("contact.models"))
WITH_UNIT: dict[str, SiUnit] = {  # options that need one
    "pressure": "Pa",
    "area": "m2",
    "amplitude": "m",
    "slip_force": "N",
    "displacement": "m",
}
LENGTHS = {  # options that may have one; a number is in m
    "radius_g": "--radius-G",
    "radius_p": "--radius-P",
    "h": "--h",
    "approach": "--approach",
}
SETTING = {  # what an option of an analysis stands for
    "preload": "contact.preload_N",
    "pressure": "contact.nominal_pressure_Pa",
    "area": "joint.area_m2",
    "friction": "material.friction_coefficient",
    "material": "material.preset",
    "model": "contact.model",
    "amplitude": "answer.amplitude_m",
    "slip_force": "answer.slip_force_N",
    "displacement": "answer.displacement_m",
    "m": "families.m",
    "n": "families.n",
    "radius_g": "families.radius_G_m",
    "radius_p": "families.radius_P_m",
    "h": "families.h_m",
    "approach": "families.approach_m",
    "dataset": "reading.dataset",
    "unit": "reading.unit",
    "lateral_unit": "reading.lateral_unit",
    "pixel_size": "reading.pixel_size",
    "sensitivity": "run.sensitivity",
    "figures": "run.figures",
    "render": "run.render",
    "meshes": "run.meshes",
    "workers": "run.workers",
}
PATH = click.Path(path_type=Path)


class _Range(click.FloatRange):
    """A range that nan, which is neither below nor above it, does not lie in."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Read a number."""
        number: float = super().convert(value, param, ctx)
        if number != number:
            self.fail(f"{value} is not in the range {self.min}<=x<={self.max}.", param, ctx)
        return number


SHARE = _Range(0.0, 1.0)


def _options(*options: Any) -> Callable[[Any], Any]:
    """Join some options to one decorator."""

    def add(command: Any) -> Any:
        for option in reversed(options):
            command = option(command)
        return command

    return add


def one_alone(_: click.Context, option: click.Parameter, names: tuple[str, ...]) -> str | None:
    """Return the one value of an option whose other ones would be lost without a word."""
    if len(names) > 1:
        raise click.UsageError(
            f"--{option.name}: got {' and '.join(names)}; expected one; run again for the other"
        )
    return names[0] if names else None


verbose_option = click.option("-v", "--verbose", is_flag=True, help="Show tracebacks and details.")
result_options = _options(  # of every command with a result
    click.option("-o", "--out", type=PATH, help="Output folder."),
    click.option("--json", "as_json", is_flag=True, help="Only the numbers, as JSON, on stdout."),
    click.option("-q", "--quiet", is_flag=True, help="Nothing but errors, on stderr."),
    verbose_option,
)
settings_options = _options(  # of every command that takes settings
    click.option("-c", "--config", type=PATH, help="Settings (TOML)."),
    click.option(
        "--set",
        "overrides",
        multiple=True,
        metavar="TABLE.KEY=VALUE",
        help="Change one setting; repeatable.",
    ),
)
joint_options = _options(  # of every command that answers for a joint
    click.option("--preload", metavar="10kN", help="Normal load of one joint; a number is in N."),
    click.option("--pressure", metavar="2MPa", help="Nominal pressure, in place of the preload."),
    click.option("--area", metavar="12cm2", help="Nominal area of one joint; else the scan's."),
    click.option(
        "--material",
        type=click.Choice(tuple(MATERIALS)),
        help="Moduli and yield stress of both faces.",
    ),
    click.option("--friction", type=float, metavar="0.15", help="Friction coefficient."),
    click.option("--amplitude", metavar="0.5um", help="Answer at this amplitude, joints rigid."),
    click.option("--slip-force", metavar="20N", help="Answer at this slip force of a joint."),
    click.option("--displacement", metavar="10nm", help="Answer at this slip of a joint."),
    settings_options,
)
reading_options = _options(  # of every command that reads scans
    click.option(
        "--dataset", help="Map of a file with several: dataset, array, variable or channel."
    ),
    click.option("--unit", type=click.Choice(WORDS), help="Unit of the heights."),
    click.option("--lateral-unit", type=click.Choice(WORDS), help="Unit of the pixel size."),
    click.option(
        "--pixel-size",
        type=(float, float),
        metavar="DY DX",
        help="Size of a pixel, where the file does not say; needs --lateral-unit.",
    ),
)
analysis_options = _options(  # of every command that analyses scans
    joint_options,
    click.option("--model", type=click.Choice(MODELS), help="Contact model."),
    reading_options,
    click.option(
        "--sensitivity/--no-sensitivity",
        default=None,
        help="Sweep cut, pruning, filter and level around what was chosen.",
    ),
    click.option("--figures/--no-figures", default=None, help="Pictures of every stage."),
    click.option("--render/--no-render", default=None, help="The PyVista picture."),
    click.option("--meshes/--no-meshes", default=None, help="Caps and face for ParaView."),
    result_options,
)


def settings_of(
    config: Path | None, overrides: tuple[str, ...], verbose: bool, **options: Any
) -> "Settings":
    """Read the file, then `--set`, then the options of their own."""
    from capslip.settings import load_settings

    for name, unit in WITH_UNIT.items():
        if options.get(name) is not None:
            options[name] = in_si(options[name], unit, f"--{name.replace('_', '-')}")
    if options.get("preload") is not None:
        options["preload"] = preload_in_N(options["preload"])
    for name, told in LENGTHS.items():
        if options.get(name) is not None:
            options[name] = number_in_si(options[name], "m", told)
    given = {SETTING[name]: value for name, value in options.items() if value is not None}
    for name, value in given.items():
        if isinstance(value, float) and value != value:
            raise SettingsError(f"{name}: got nan; expected a finite number")
    texts = tuple(f"{name}={_toml(value)}" for name, value in given.items())
    settings = load_settings(config, (*overrides, *texts))
    _tell_repeated((*overrides, *texts))
    return settings


def _tell_repeated(overrides: tuple[str, ...]) -> None:
    """Say which settings were given several times, with other values: the last of them counts."""
    from capslip.console import Progress

    values: dict[str, list[str]] = {}
    for override in overrides:
        name, _, value = override.partition("=")
        values.setdefault(name.strip(), []).append(value.strip())
    for name, given in values.items():
        if any(_number(one) != _number(given[-1]) for one in given):
            several = " and ".join(dict.fromkeys(given))
            Progress(quiet=False).warn(f"{name}: got {several}; the last counts, {given[-1]}")


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def not_of_reading(settings: "Settings") -> str | None:
    """Return which settings were given to a command that reads scans and analyses none; or None.

    The noise of a mean is what its scans differ by: none that is given is read.
    """
    from capslip.setting_errors import changed

    others = [name for name in settings.__struct_fields__ if name not in ("reading", "run")]
    names = changed(settings, others)
    if not names:
        return None
    are = "is" if len(names) == 1 else "are"
    return (
        f"settings_ignored: {', '.join(names)} {are} not used: scans are read and averaged here, "
        "and none is analysed; of the settings reading.* alone counts"
    )


def shard_of(text: str) -> tuple[int, int]:
    """Return part and parts of a batch, from 2/8."""
    part, _, parts = text.partition("/")
    if not (part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
        raise SettingsError(f"--shard: got {text}; expected I/N with I from 1 to N, such as 2/8")
    return int(part), int(parts)


def above_zero(value: float | None, option: str) -> float | None:
    """Return a limit of an option, None where there is none.

    Raises
    ------
    SettingsError
        If it is not a finite number above 0.
    """
    if value is not None and not 0.0 < value < float("inf"):
        raise SettingsError(f"{option}: got {value:g}; expected a finite number above 0")
    return value


def preload_in_N(text: str) -> float:
    """Return a preload in N; a number without a unit is in N."""
    return number_in_si(text, "N", "--preload")


def number_in_si(text: str, unit: SiUnit, option: str) -> float:
    """Return a number of an option in SI; one without a unit is in that of SI.

    Examples
    --------
    >>> number_in_si("240nm", "m", "--h"), number_in_si("2.4e-7", "m", "--h")
    (2.4e-07, 2.4e-07)
    """
    try:
        return float(text)
    except ValueError:
        return in_si(text, unit, option)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(inner) for inner in value)}]"
    return repr(float(value)) if isinstance(value, float) else json.dumps(value)
