"""A problem: something that makes a number doubtful, said beside the number."""

from dataclasses import dataclass
from typing import Literal

Severity = Literal["info", "warning", "error"]


@dataclass(frozen=True)
class Problem:
    """One thing that a reader of the results should know."""

    code: str
    severity: Severity
    message: str
