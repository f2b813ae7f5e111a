"""What an analysis can be written as for another program, one file in `output/exports` each.

Each holds an `Export` named `EXPORT` under the file's own name.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from capslip import registry
from capslip.contact.rung import rung
from capslip.contact.solvers.unloading import SMALL_SLIP
from capslip.errors import SettingsError, one_of
from capslip.problems import Problem
from capslip.structure.jenkins import read_as
from capslip.units import percent

if TYPE_CHECKING:
    from capslip.result import JointResult
    from capslip.settings import Settings
    from capslip.structure.jenkins import JenkinsElements

FOLDER = "output.exports"


@dataclass(frozen=True)
class Export:
    """One way to write the joint for another program."""

    files: tuple[str, ...]  # in the folder of the result
    # Of one scan or of several; returns what makes the files less good than was asked for
    write: Callable[["JointResult", Path], tuple[Problem, ...]]
    # By which settings it cannot be, whatever the scan; None where they allow it
    ruled_out: Callable[["Settings"], str | None] = lambda _: None


def export_named(name: str) -> Export:
    """Return the export of that name; SettingsError where there is none."""
    known = registry.names(FOLDER)
    if name not in known:
        raise SettingsError(f"export: got {name}; {one_of(known, name)}")
    return cast(Export, registry.entry(FOLDER, name).EXPORT)


def check_export(name: str, settings: "Settings") -> None:
    """Refuse, before the work, an export that settings rule out.

    Raises
    ------
    SettingsError
        If the model slips only as a whole, or nothing is of that name.
    """
    model, reason = settings.contact.model, export_named(name).ruled_out(settings)
    if reason is not None:
        raise SettingsError(f"--export {name}: {reason}")
    if model != "auto" and rung(model).made_from == "nothing":
        raise SettingsError(
            f"--export {name}: contact.model is {model}, which slips only as a whole; expected a "
            "model with caps; take one slider with the force at gross slip"
        )


def refuse_varying(settings: "Settings", what: str) -> str | None:
    """Return why there is none of what needs a constant load, where it oscillates."""
    if settings.slip.normal_amplitude_ratio == 0.0:
        return None
    return f"{what}; expected slip.normal_amplitude_ratio = 0"


def inexact(
    file: str, sliders: "Sequence[JenkinsElements]", asked: float, tolerance: float
) -> tuple[Problem, ...]:
    """Return what sliders say of themselves that lose the energy less well than was asked for.

    Parameters
    ----------
    file : str
        That holds them.
    sliders : sequence of JenkinsElements
        Of one joint or under several pressures; the worst of them counts.
    asked : float
        Relative error of the energy of a cycle that was asked for.
    tolerance : float
        From which such an error is a warning.
    """
    told_as_asked = read_as(asked)
    if max(one.energy_error for one in sliders) < told_as_asked:
        return ()
    shares = [
        float(one.force_N(one.good_from_m(told_as_asked)) / one.slip_force_N.sum())
        for one in sliders
    ]
    error = max(one.energy_error_from(SMALL_SLIP) for one in sliders)
    message = (
        f"{file}: its sliders lose the energy of a cycle within {percent(asked)} from "
        f"{percent(max(shares))} of mu N on"
    )
    if error >= told_as_asked:
        message += f"; from a tenth of mu N on they may be off by {percent(error)}"
    return (Problem("export_inexact", "warning" if error > tolerance else "info", message),)
