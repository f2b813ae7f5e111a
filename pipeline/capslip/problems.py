"""Problems: what makes a number doubtful, said beside the number, and the registry of their kinds.

A problem carries the numbers of one case in its message. What it means, what it does to stiffness
and energy, and what to do about it stand once, in `problems.toml`, from which `docs/warnings.md` is
written, too.
"""

import sys
import tomllib
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Literal

from capslip.units import readable

Severity = Literal["info", "warning", "error"]


@dataclass(frozen=True)
class Kind:
    """What all problems of one code have in common.

    Attributes
    ----------
    code : str
        The name that results, tables and documents use.
    severities : tuple of str
        Those that a problem of this kind can have.
    meaning, effect, remedy : str
        What was seen; what it does to the stiffness K and the energy W, or to the counts; what to
        run or to change next.
    in_interval : bool
        Whether the estimated error of the model holds that effect, and so the interval of the
        answer.
    spoils_all : bool
        Whether every number may be that of another face or joint, so that it leads the verdict.
    """

    code: str
    severities: tuple[Severity, ...]
    meaning: str
    effect: str
    remedy: str
    in_interval: bool = False
    spoils_all: bool = False


def _read_kinds() -> dict[str, Kind]:
    text = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
    return {
        code: Kind(code, tuple(row.pop("severities")), **row)
        for code, row in tomllib.loads(text).items()
    }


KINDS = _read_kinds()


@dataclass(frozen=True)
class Effect:
    """What a doubt moves, as relative changes that are not negative; None: not known."""

    tangential_stiffness: float | None
    energy: float | None  # at given forces
    loss_factor: float | None

    @property
    def greatest(self) -> float:
        """The greatest of those that are known, 0 where none is."""
        return max((one for one in astuple(self) if one is not None), default=0.0)


@dataclass(frozen=True)
class Problem:
    """One thing that a reader of the results should know.

    Raises
    ------
    ValueError
        If the code is not in the registry, or cannot have that severity: a defect of the program.
    """

    code: str
    severity: Severity
    message: str
    effect: Effect | None = None
    step: str | None = None  # the remedy of this case: with its number, or one that can be taken

    def __post_init__(self) -> None:
        if self.severity not in self.kind.severities:
            raise ValueError(f"a problem {self.code} cannot be of severity {self.severity!r}")

    @property
    def text(self) -> str:
        """The message, its quantities as people write them."""
        return readable(self.message)

    @property
    def greatest_effect(self) -> float:
        """The greatest change that was measured; 0 where none was."""
        return 0.0 if self.effect is None else self.effect.greatest

    @property
    def remedy(self) -> str:
        """What to do next: of this case where it knows, else of all of its kind."""
        return self.step or self.kind.remedy

    @property
    def advice(self) -> str:
        """The remedy as the end of a sentence, without its stop."""
        text = self.remedy if self.remedy.endswith("...") else self.remedy.removesuffix(".")
        return text[:1].lower() + text[1:]

    @property
    def kind(self) -> Kind:
        """What all problems of this code have in common."""
        if self.code not in KINDS:
            raise ValueError(f"no problem {self.code!r} is registered in problems.toml")
        return KINDS[self.code]


def warnings_page() -> str:
    """Return the text of `docs/warnings.md`: every kind of problem, as the registry has it."""
    lines = [
        "# What each warning means",
        "",
        "Written from `pipeline/capslip/problems.toml` by `make warnings`; edit that file. A",
        "result is `failed` with an error among its problems, `check` with a warning, else `ok`;",
        "an `info` changes no status. K is the stiffness, W the energy lost per cycle.",
    ]
    for kind in KINDS.values():
        lines += [
            "",
            f"## {kind.code}",
            "",
            f"*{' or '.join(kind.severities)}*. {kind.meaning}",
            "",
        ]
        lines += [f"- Effect: {kind.effect}"]
        lines += ["- Interval: holds what the message names."] if kind.in_interval else []
        lines += ["- Verdict: leads it, whatever others move."] if kind.spoils_all else []
        lines += [f"- Next: {kind.remedy}"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(warnings_page())
