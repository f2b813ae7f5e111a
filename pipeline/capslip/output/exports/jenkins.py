"""The slip curve of one joint as parallel Jenkins elements."""

from pathlib import Path
from typing import TYPE_CHECKING

from capslip.errors import ContactError
from capslip.output.export import Export
from capslip.structure.jenkins import jenkins, write_jenkins

if TYPE_CHECKING:
    from capslip.result import JointResult


def write(result: "JointResult", folder: Path) -> None:
    """Write `jenkins.csv`."""
    if result.slip is None:
        raise ContactError("it needs a slip curve, which this analysis does not have")
    write_jenkins(jenkins(result.slip), folder / "jenkins.csv")


EXPORT = Export(("jenkins.csv",), write)
