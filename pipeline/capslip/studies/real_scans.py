"""What the program says of real scans, one row each: the tables of `docs/real-scans.md`.

`python -m capslip.studies.real_scans FOLDER [--set KEY=VALUE ...]` prints them. Nobody knows the
right answer for these faces: the tables say what answered, what is doubted, and by how much.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from capslip.analysis import analyze
from capslip.errors import CapslipError
from capslip.output.quantity import engineering
from capslip.settings import Settings, load_settings
from capslip.studies.page import Row, table
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers.faces import load_faces

AS_A_JOINT = (
    "contact.nominal_pressure_Pa=2e6",
    "material.preset='steel'",
    "material.friction_coefficient=0.2",
)
HEAD = (
    *("scan", "points", "side [mm]", "caps", "answered by", "contacts", "greatest pressure [GPa]"),
    *("stiffness [MN/m]", "energy at a quarter of mu N", "loss factor of the joint"),
    *("status", "warnings"),
)


def main() -> None:
    """Print the tables of every scan of a folder that can be read."""
    print_of_folder(real_scans, __doc__)


def print_of_folder(study: Callable[[Path, Sequence[str]], str], about: str) -> None:
    """Print what a study says of a folder of scans, both named on the command line.

    Parameters
    ----------
    study : callable
        Takes the folder and settings as `--set` takes them.
    about : str
        Its first line is that of the help.
    """
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides")
    given = parser.parse_args()
    sys.stdout.write(f"{study(given.folder, (*AS_A_JOINT, *given.overrides))}\n")


def scans_of(folder: Path, settings: Settings) -> Iterator[tuple[str, HeightMap]]:
    """Give name and map of every file that can be read as a scan."""
    for file in sorted(path for path in folder.iterdir() if path.is_file()):
        try:
            surface, _ = load_faces(file, None, settings.reading)
        except CapslipError:
            continue
        yield file.name, surface


def real_scans(folder: Path, overrides: Sequence[str] = AS_A_JOINT) -> str:
    """Return in Markdown the answer, verdict and warnings of every scan of a folder.

    Parameters
    ----------
    folder : Path
        What cannot be read as a scan is left out; a scan without an answer is named.
    overrides : sequence of str
        Settings as `--set` takes them.
    """
    settings = load_settings(overrides=tuple(overrides))
    rows, texts = [], []
    for name, surface in scans_of(folder, settings):
        try:
            summary = analyze(surface, settings).summary()
        except CapslipError as error:
            texts.append(f"`{name}`: no answer: {error}")
            continue
        rows.append((f"`{name}`", *_row(summary)))
        texts.append(f"`{name}`: {summary['verdict']}.\n{_doubts(summary)}")
    return "\n\n".join([table(HEAD, rows), *texts])


def _row(summary: Row) -> tuple[str, ...]:
    surface, contact = summary["surface"], summary["contact"] or {}
    answer, interval = summary["answer"] or {}, (summary["answer"] or {}).get("interval") or {}

    def with_interval(name: str, written: Callable[[float], str] = "{:.3g}".format) -> str:
        value, bounds = answer.get(name), interval.get(name)
        if value is None:
            return "none"
        between = "" if bounds is None else f" ({written(bounds[0])} to {written(bounds[1])})"
        return f"{written(value)}{between}"

    pressure_Pa = contact.get("max_pressure_Pa")
    shape, pixel_size_m = surface["shape"][::-1], surface["pixel_size_m"][::-1]  # along x, y
    sides_m = [points * pixel for points, pixel in zip(shape, pixel_size_m, strict=True)]
    return (
        " x ".join(map(str, shape)),
        " x ".join(f"{side * 1e3:.3g}" for side in sides_m),
        str(summary["hills"]["caps"]),
        str(contact.get("model", "nothing")),
        str(contact.get("contacts", 0)),
        "" if pressure_Pa is None else f"{pressure_Pa / 1e9:.2g}",
        with_interval("tangential_stiffness_N_per_m", lambda one: f"{float(f'{one / 1e6:.3g}'):g}"),
        with_interval("energy_J", lambda one: engineering(one, "J")),
        with_interval("joint_loss_factor"),
        summary["status"],
        str(len(_warnings(summary))),
    )


def _warnings(summary: Row) -> list[Any]:
    return [problem for problem in summary["problems"] if problem["severity"] != "info"]


def _doubts(summary: Row) -> str:
    """Return one line a warning, with what it moves where that was measured."""
    lines = [
        f"- `{problem['code']}` ({problem['severity']}): {problem['message']}"
        for problem in _warnings(summary)
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
