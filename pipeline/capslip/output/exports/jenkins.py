"""The slip curve of one joint as parallel Jenkins elements."""

from pathlib import Path
from typing import TYPE_CHECKING

from capslip.errors import ContactError
from capslip.output.export import Export, inexact, refuse_varying
from capslip.problems import Problem
from capslip.structure.jenkins import TOLERANCE, jenkins, write_jenkins

if TYPE_CHECKING:
    from capslip.result import JointResult
    from capslip.settings import Settings


def write(result: "JointResult", folder: Path) -> tuple[Problem, ...]:
    """Write `jenkins.csv`."""
    if result.slip is None:
        raise ContactError("it needs a slip curve, which this analysis does not have")
    elements = jenkins(result.slip)
    write_jenkins(elements, folder / "jenkins.csv")
    return inexact("jenkins.csv", [elements], TOLERANCE, result.settings.contact.tolerance)


def _ruled_out(settings: "Settings") -> str | None:
    return refuse_varying(settings, "its sliders slip at a constant force")


EXPORT = Export(("jenkins.csv",), write, _ruled_out)
