"""A balanced face by caps: how it holds under changes of the map that change nothing pressed.

Tilting the input, lowering points that never touch, another cut to start from, a mirrored or
transposed map: none of them is another face, so energies, stiffness, approach, contacts and
families must stay. And caps are compared with boundary elements that turn freely, too.
"""

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from capslip.analysis import analyze_once
from capslip.contact.models.boundary_elements import RUNG as BOUNDARY_ELEMENTS
from capslip.contact.models.interacting import RUNG as INTERACTING
from capslip.result import Analysis
from capslip.settings import Settings
from capslip.studies.faces.scenes import cases
from capslip.studies.faces.synthetic import synthetic_surface
from capslip.studies.page import table
from capslip.surface.heightmap import HeightMap

SHAPE, PIXEL_M = (400, 600), (1e-4, 1e-4)
FORCE_SHARES = (0.1, 0.25, 0.5, 0.75)  # of mu N, at which the energies are compared
CUTS = (0.05, 0.20, 0.30)  # to start from, beside the default of 0.10
TILT_M, LOWERED_M = 8e-6, 1e-6
RELIEFS = 10.0  # of the face, that the steep tilts rise across it
STEEP = {"along x": (1.0, 0.0), "across": (0.6, -0.8), "against both": (-0.7, -0.7)}  # (x, y)
GROUPS = ("caps", "waves")
REACH = {"caps": 1e-3, "waves": 1e-2}  # relative change that is reached


@dataclass(frozen=True, eq=False)
class Face:
    """One seeded face and its load."""

    name: str
    group: str
    preload_N: float
    surface: HeightMap


@dataclass(frozen=True, eq=False)
class Answer:
    """What an analysis says, NaN where it says nothing."""

    energy_J: np.ndarray  # (4,), at `FORCE_SHARES`
    stiffness_N_per_m: float
    approach_m: float
    contacts: int
    families: tuple[int, int]
    h_m: float
    settled: bool
    model: str

    @classmethod
    def of(cls, analysis: Analysis) -> "Answer":
        """Return the numbers of an analysis."""
        found, slip, families = analysis.contact, analysis.slip, analysis.families
        balanced = analysis.level is not None and analysis.level.moved == 0.0
        counts, h_m = (families.m, families.n), families.h_m or np.nan
        if found is None or slip is None:
            return cls(np.full(4, np.nan), np.nan, np.nan, 0, counts, h_m, False, "")
        energy_J = slip.energy_at_force_J(np.array(FORCE_SHARES) * slip.total_slip_force_N)
        return cls(
            *(energy_J, found.stiffness_N_per_m, found.approach_m, found.contacts),
            *(counts, h_m, balanced, found.model),
        )

    def change_from(self, other: "Answer") -> np.ndarray:
        """Return relative changes of W (4), stiffness, approach and h; no h is as good as none."""
        mine, its = (
            np.append(one.energy_J, (one.stiffness_N_per_m, one.approach_m, one.h_m))
            for one in (self, other)
        )
        change = np.abs(mine / its - 1.0)
        if np.isnan(self.h_m) and np.isnan(other.h_m):
            change[6] = 0.0
        return np.where(np.isnan(change), np.inf, change)

    def counts_as(self, other: "Answer") -> bool:
        """Whether contacts, m and n are equal."""
        return (self.contacts, self.families) == (other.contacts, other.families)


def faces(seed: int, group: str) -> Iterator[Face]:
    """Make the faces of caps or waves of a seed; the caps lie where they fall.

    Examples
    --------
    >>> next(faces(0, "caps")).surface.shape
    (400, 600)
    """
    for case in cases(seed):
        if case.group == group and case.scene is not None:
            scene = replace(case.scene, shape=SHAPE, pixel_size_m=PIXEL_M, balanced=False)
            surface, _ = synthetic_surface(scene, case.name)
            yield Face(f"{case.name}, seed {seed}", group, case.preload_N, surface)


def settings_of(face: Face, model: str = "auto", cut: float | None = None) -> Settings:
    """Return the defaults with the load of a face, another model, or another cut to start from."""
    plain = Settings()
    contact = msgspec.structs.replace(plain.contact, preload_N=face.preload_N, model=model)
    hills = plain.hills
    if cut is not None:
        hills = msgspec.structs.replace(hills, material_ratio=cut)
    return msgspec.structs.replace(plain, contact=contact, hills=hills)


def changes(face: Face, plain: Analysis) -> dict[str, tuple[HeightMap, float | None]]:
    """Return maps, and cuts to start from, that must not change the answer."""
    z_m, pixel_m = face.surface.height_m, face.surface.pixel_size_m
    ny, nx = z_m.shape
    x = (np.arange(nx) + 0.5) / nx
    y = ((np.arange(ny) + 0.5) / ny)[:, None]
    steep_m = RELIEFS * float(np.ptp(z_m))
    pressed_m = plain.conditioned.surface.height_m  # what lies below half of it never touches
    low = (pressed_m < np.nanmedian(pressed_m)) & (x < 0.5)
    maps = {"tilted by 8 um": z_m + TILT_M * x}
    for name, (along_x, along_y) in STEEP.items():
        maps[f"10 reliefs {name}"] = z_m + steep_m * (along_x * x + along_y * y)
    maps["1 um lower on one side"] = np.where(low, z_m - LOWERED_M, z_m)
    maps["mirrored"] = np.ascontiguousarray(z_m[:, ::-1])
    found: dict[str, tuple[HeightMap, float | None]] = {
        name: (HeightMap(one_m, pixel_m), None) for name, one_m in maps.items()
    }
    found["transposed"] = (HeightMap(np.ascontiguousarray(z_m.T), pixel_m[::-1]), None)
    for cut in CUTS:
        found[f"cut of {cut:.0%}"] = (face.surface, cut)
    return found


@dataclass(frozen=True, eq=False)
class Held:
    """How one face answers to one change."""

    face: str
    group: str
    change: str
    relative: np.ndarray  # (7,), of W (4), stiffness, approach, h
    counts: bool  # whether contacts, m and n stay
    settled: bool
    model: bool  # whether the same model was chosen

    def __str__(self) -> str:
        """Return one line: what moved by how much."""
        worst = " ".join(f"{one:.1e}" for one in self.relative)
        notes = "" if self.counts else ", other counts"
        notes += "" if self.settled else ", not settled"
        notes += "" if self.model else ", another model"
        return f"{self.face}, {self.change}: {worst}{notes}"

    @property
    def holds(self) -> bool:
        """Whether the figure to reach is reached."""
        return self.counts and float(self.relative.max()) <= REACH[self.group]


def held(face: Face) -> Iterator[Held]:
    """Analyse a face and all its changes."""
    analysis = analyze_once(face.surface, settings_of(face))
    plain = Answer.of(analysis)
    for name, (surface, cut) in changes(face, analysis).items():
        answer = Answer.of(analyze_once(surface, settings_of(face, cut=cut)))
        yield Held(
            *(face.name, face.group, name, answer.change_from(plain), answer.counts_as(plain)),
            *(plain.settled and answer.settled, plain.model == answer.model),
        )


def table_of_changes(rows: list[Held]) -> str:
    """Return the worst change of each kind, and how many faces hold."""
    head = "group, change, faces, hold, worst W, worst stiffness, worst approach, worst h"
    head += ", other counts, not settled"
    lines = []
    for group, change in dict.fromkeys((row.group, row.change) for row in rows):
        some = [row for row in rows if (row.group, row.change) == (group, change)]
        worst = np.array([row.relative for row in some]).max(axis=0)
        worst = np.append(worst[:4].max(), worst[4:])
        n_other = sum(not row.counts for row in some)
        n_unsettled = sum(not row.settled for row in some)
        n_held = sum(row.holds for row in some)
        sizes = [f"{one:.1e}" for one in worst]
        lines.append((group, change, len(some), n_held, *sizes, n_other, n_unsettled))
    return table(head.split(", "), lines)


@dataclass(frozen=True, eq=False)
class Compared:
    """Interacting caps against boundary elements on one face."""

    face: str
    group: str
    approach: float  # relative error
    energy: np.ndarray  # (4,), relative errors
    contacts: tuple[int, int]  # of caps, of boundary elements


def compared(face: Face) -> Compared:
    """Press a face by interacting caps and by boundary elements, both free to turn."""
    caps, exact = (
        Answer.of(analyze_once(face.surface, settings_of(face, one.name)))
        for one in (INTERACTING, BOUNDARY_ELEMENTS)
    )
    error = caps.energy_J / exact.energy_J - 1.0
    approach = caps.approach_m / exact.approach_m - 1.0
    return Compared(face.name, face.group, approach, error, (caps.contacts, exact.contacts))


def table_of_errors(rows: list[Compared]) -> str:
    """Return each face, and the median and worst sizes of each group, in per cent."""
    lines: list[tuple[str, ...]] = []

    def line(name: str, errors: np.ndarray, contacts: str) -> None:
        lines.append((name, *(f"{100 * error:.2f}" for error in errors), contacts))

    for group in dict.fromkeys(row.group for row in rows):
        some = [row for row in rows if row.group == group]
        errors = np.array([[row.approach, *row.energy] for row in some])
        for row, error in zip(some, errors, strict=True):
            line(row.face, error, f"{row.contacts[0]} of {row.contacts[1]}")
        equal = sum(row.contacts[0] == row.contacts[1] for row in some)
        line(f"{group}: median", np.median(np.abs(errors), axis=0), f"{equal} of {len(some)} equal")
        line(f"{group}: worst", np.abs(errors).max(axis=0), "")
        over = np.median(np.abs(errors[:, 1:]), axis=1)
        lines.append(
            (f"{group}: worst median over forces", "", f"{100 * over.max():.2f}", *" " * 4)
        )
    shares = [f"W({share:g})" for share in FORCE_SHARES]
    return table(("per cent", "approach", *shares, "contacts"), lines)


def main(write: Callable[[str], object] = sys.stdout.write) -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(prog="python -m capslip.studies.level", description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--part", choices=("changes", "errors", "both"), default="both")
    chosen = parser.parse_args()
    some = [face for seed in chosen.seeds for group in GROUPS for face in faces(seed, group)]
    if chosen.part != "errors":
        rows = [row for face in some for row in held(face)]
        write("".join(f"{row}\n" for row in rows if not row.holds))
        write(f"\n{table_of_changes(rows)}\n\n")
    if chosen.part != "changes":
        write(f"{table_of_errors([compared(face) for face in some])}\n")
