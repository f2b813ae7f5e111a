"""The slip curve of one joint as parallel Jenkins elements."""

from pathlib import Path
from typing import TYPE_CHECKING

from capslip.errors import ContactError
from capslip.output.export import Export, inexact
from capslip.problems import Problem
from capslip.structure.jenkins import TOLERANCE, jenkins, write_jenkins

if TYPE_CHECKING:
    from capslip.result import JointResult


def write(result: "JointResult", folder: Path) -> tuple[Problem, ...]:
    """Write `jenkins.csv`."""
    if result.slip is None:
        raise ContactError("it needs a slip curve, which this analysis does not have")
    elements = jenkins(result.slip)
    write_jenkins(elements, folder / "jenkins.csv")
    return inexact("jenkins.csv", [elements], TOLERANCE, result.settings.contact.tolerance)


EXPORT = Export(("jenkins.csv",), write)
