"""What the limits study is made of: an axis, and its cases of a face, a load and what is wrong."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

from capslip.studies.faces.synthetic import Scene, Truth
from capslip.studies.page import Row
from capslip.surface.heightmap import HeightMap

PRELOAD_N = 460.0  # of the paper
SHARES = (0.25, 0.5, 0.75)  # T / (mu N) at which energies are compared

Change = Callable[[HeightMap, Truth], HeightMap]
FaceChange = Callable[[HeightMap, Truth, int], HeightMap]  # the last: points along a pixel's side
Tries = Callable[[int, Any], Iterable[Row]]  # seed and value: what each case there has


@dataclass(frozen=True)
class Case:
    """One face, one load, and what is wrong with either or with the scan."""

    axis: str
    severity: float
    name: str
    scene: Scene
    preload_N: float = PRELOAD_N
    overrides: tuple[str, ...] = ()
    shares: tuple[float, ...] = SHARES
    face_change: FaceChange | None = None  # of the face itself, so of the truth too
    scan_change: Change | None = None  # of what the instrument makes of it


@dataclass(frozen=True)
class Axis:
    """One way to go wrong; its cases run from harmless to hopeless.

    Each of `values` is a severity, unless the cases that `tries` makes there have one of their own.
    `codes` are the warnings that name the cause. `misread` says that the scan shows another face,
    as good as the true one, so that no estimate of a model's error can know of it.
    """

    name: str
    quantity: str  # what the severity is, with its unit
    values: tuple[Any, ...]
    tries: Tries
    codes: tuple[str, ...]
    logarithmic: bool = True
    misread: bool = False
    cases: tuple[Case, ...] = ()

    def on_faces_of(self, seed: int) -> "Axis":
        """Return the axis with its cases on the faces of a seed."""
        cases = tuple(
            Case(**{"axis": self.name, "severity": value, **found})
            for value in self.values
            for found in self.tries(seed, value)
        )
        return replace(self, cases=cases)


def clean(scene: Scene) -> Scene:
    """Return the scene of the face itself: without form, noise and what the instrument lost."""
    return replace(
        scene,
        noise_rms_m=0.0,
        tilt=(0.0, 0.0),
        bow_m=(0.0, 0.0),
        cylinder_radius_m=None,
        n_spikes=0,
        non_measured_fraction=0.0,
        n_patches=0,
    )
