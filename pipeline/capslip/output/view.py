"""What the pictures of a result in three dimensions show, read from its folder.

The map is read in blocks and thinned on the way, so that a map of a hundred million points costs no
more memory than its mesh. Everything here is without a window: pictures only draw it.
"""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from capslip.caps.table import CapFlag
from capslip.errors import OutputError
from capslip.output.canvas import FAMILY_COLOUR, family_names, height_limits
from capslip.output.mesh import FACE_CELLS, thinned_lines
from capslip.output.quantity import engineering, scaled
from capslip.output.staging import read_json
from capslip.output.zones import Zones, loss_shares, read_zones, zone_at
from capslip.surface.filling import from_nearest

COLOURS = ("family", "load", "radius", "flag", "loss")
OF_CONTACTS = ("load", "loss")  # colours that only single contacts tell
# Neither green nor red, which say what sticks and what slips
FLAG_COLOUR = ("#0072B2", "#E69F00", "#882255", "#CC79A7", "#332288", "#56B4E9", "#F0E442")
FLAGGED = 5  # kinds of flags that are told apart; the others are one
CAP_COLUMNS = (
    *("x_m", "y_m", "peak_height_m", "cap_height_m", "diameter_m", "radius_m"),
    *("family", "flags"),
)
BLOCK = 2**24  # points of the map in memory at once
DEFAULT_FORCE = 0.25  # of gross slip, where the answer does not say
SEEN_AREA = 0.02  # of the face: what contact points that are enlarged to be seen cover at most
ENLARGED = 1.5  # in area: from there on it is said
SEEN_SIDE = 1 / 200  # of the longer side of the face: that of such a point at most


@dataclass(frozen=True, eq=False)
class View:
    """What there is to be seen; n usable caps, thinned rows and columns of the map."""

    path: Path  # result.h5
    summary: dict[str, Any]  # empty where there is no summary.json beside it
    shape: tuple[int, int]
    pixel_size_m: tuple[float, float]
    y_m: np.ndarray  # (rows,)
    x_m: np.ndarray  # (columns,)
    height_m: np.ndarray  # (rows, columns); of two faces those of their sum
    second_m: np.ndarray | None  # (rows, columns), its part in the sum; the nearest beside it
    sz_m: float  # from the lowest to the highest point of the whole map
    cap: np.ndarray  # (n,), row in caps.csv, from 0
    columns: dict[str, np.ndarray]  # of the caps, each of shape (n,)
    zones: Zones | None
    hill_N: np.ndarray | None  # (n,), what their hills bear of a map that was pressed
    pixel_m: np.ndarray  # (p, 3), where the contact pixels of a map are

    @property
    def name(self) -> str:
        """Name of the result."""
        return str(self.summary.get("name") or self.path.parent.name)

    @property
    def side_m(self) -> tuple[float, float]:
        """Sides (y, x) of the face."""
        sides = zip(self.shape, self.pixel_size_m, strict=True)
        side_y_m, side_x_m = (n * size for n, size in sides)
        return side_y_m, side_x_m

    @cached_property
    def limits_m(self) -> tuple[float, float]:
        """Heights that a picture spans; what lies beyond is drawn at them."""
        return height_limits(self.height_m, self.columns["peak_height_m"])

    @cached_property
    def first_limits_m(self) -> tuple[float, float]:
        """The same of the first of two faces."""
        of = self.columns
        peak_m = of["peak_height_m"] - self.second_at(of["x_m"], of["y_m"])
        return height_limits(self.first_m, peak_m)

    @property
    def first_m(self) -> np.ndarray:
        """Heights of the first of two faces, or of the only one, (rows, columns)."""
        return self.height_m if self.second_m is None else self.height_m - self.second_m

    def second_at(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Return the part of the second face in the heights at some places."""
        if self.second_m is None:
            return np.zeros_like(x_m)
        from scipy.ndimage import map_coordinates

        lines = (self.y_m, y_m), (self.x_m, x_m)
        at = [np.interp(place_m, line_m, np.arange(len(line_m))) for line_m, place_m in lines]
        return np.asarray(map_coordinates(self.second_m, at, order=1))

    def exaggeration(self, limits_m: tuple[float, float]) -> float:
        """Return a round factor that makes heights a tenth of the longer side, at least 1."""
        low_m, high_m = limits_m
        return round_factor(0.1 * max(self.side_m) / (high_m - low_m)) if high_m > low_m else 1.0

    @property
    def point_side_m(self) -> float:
        """Side of the square that is drawn for a contact pixel of a map.

        It is that of the pixel, or larger where few touch: none would be seen. All together never
        look like more of the face than they are, but for the little that shows them at all.
        """
        side_y_m, side_x_m = self.side_m
        each_m2 = SEEN_AREA * side_y_m * side_x_m / max(len(self.pixel_m), 1)
        seen_m = min(math.sqrt(each_m2), SEEN_SIDE * max(self.side_m))
        return max(math.sqrt(math.prod(self.pixel_size_m)), seen_m)

    @property
    def colours(self) -> tuple[str, ...]:
        """By what the caps can be coloured: without single contacts all load would be zero."""
        of_contacts = OF_CONTACTS if self.zones is None else ()
        return tuple(by for by in COLOURS if by not in of_contacts)

    @property
    def enlarged_points(self) -> str:
        """What a picture says of contact points that are drawn larger than they are; or nothing."""
        times = self.point_side_m**2 / math.prod(self.pixel_size_m)
        if self.zones is None or not self.zones.of_map or times < ENLARGED:
            return ""
        return f"contact points are drawn about {float(f'{times:.1g}'):.0f} times as large"

    @property
    def force_share(self) -> float:
        """The force of the answer over that at gross slip."""
        answer, slip = self.summary.get("answer") or {}, self.summary.get("slip") or {}
        force_N, most_N = answer.get("slip_force_N"), slip.get("total_slip_force_N")
        return DEFAULT_FORCE if not force_N or not most_N else min(force_N / most_N, 1.0)

    @property
    def cap_load_N(self) -> np.ndarray:
        """Load of each cap, (n,), or what its hill bears of a pressed map; zero where none is."""
        if self.hill_N is not None:
            return self.hill_N
        return self._of_contacts(None if self.zones is None else self.zones.contact_load_N)

    @property
    def load_name(self) -> str:
        """What the load of a cap is called."""
        return "load" if self.hill_N is None else "load on the hill"

    @property
    def cap_loss_share(self) -> np.ndarray:
        """Share of each cap in the energy of a cycle at the force of the answer, shape (n,)."""
        share = None if self.zones is None else loss_shares(self.zones, self.force_share)
        return self._of_contacts(share)

    def _of_contacts(self, values: np.ndarray | None) -> np.ndarray:
        if self.zones is None or values is None or not len(self.cap):
            return np.zeros(len(self.cap))
        on = self.zones.cap >= 0
        total = np.bincount(self.zones.cap[on], values[on], minlength=int(self.cap.max()) + 1)
        return np.asarray(total[self.cap])

    def approach_at(self, load_share: float) -> float:
        """Return the elastic approach of the flat mate from first touch, without the bulk term."""
        if self.zones is None:
            return 0.0
        load_N, below_m = self.zones.load_N, self.zones.withdrawal_m
        return float(below_m[0] - np.interp(load_share * load_N[-1], load_N, below_m))


def cap_at(view: View, x_m: float, y_m: float) -> int | None:
    """Return the cap on whose base a place lies, the nearest apex first; None beside all."""
    if not len(view.cap):
        return None
    away_m = np.hypot(view.columns["x_m"] - x_m, view.columns["y_m"] - y_m)
    i = int(np.argmin(np.where(away_m <= 0.5 * view.columns["diameter_m"], away_m, np.inf)))
    return i if away_m[i] <= 0.5 * view.columns["diameter_m"][i] else None


@dataclass(frozen=True)
class Colouring:
    """How the caps are coloured: by a number, or by a name."""

    title: str
    value: np.ndarray  # (n,), number, or index of the name
    names: tuple[tuple[str, str], ...] = ()  # with the colour of each
    limits: tuple[float, float] = (0.0, 1.0)


def colouring(view: View, by: str) -> Colouring:
    """Return the colours of the caps.

    Parameters
    ----------
    view : View
        A result.
    by : {"family", "load", "radius", "flag", "loss"}
        What tells them apart; a range of numbers leaves the utmost percent out.
    """
    if by == "family":
        return _by_family(view.columns["family"])
    if by == "flag":
        return _by_flag(view.columns["flags"])
    if by == "radius":
        value, unit = scaled(view.columns["radius_m"], "m")
        return Colouring(f"radius R [{unit}]", value, limits=round_limits(value))
    if by == "load":
        value, unit = scaled(view.cap_load_N, "N")
        title = f"{view.load_name} [{unit}]"
        return Colouring(title, value, limits=round_limits(np.append(value, 0.0)))
    if by == "loss":
        value = 100.0 * view.cap_loss_share
        return Colouring("share of the loss [%]", value, limits=round_limits(np.append(value, 0.0)))
    raise ValueError(f"no colours by {by!r}")


def _by_family(family: np.ndarray) -> Colouring:
    present = [name for name in FAMILY_COLOUR if (family == name).any()]
    value = np.array([present.index(name) for name in family], dtype=float)
    word = family_names(family)
    names = tuple(
        (f"{word[name]} ({(family == name).sum()})", FAMILY_COLOUR[name]) for name in present
    )
    return Colouring("family", value, names)


def _by_flag(flags: np.ndarray) -> Colouring:
    first = np.array([words.split(" ")[0] for words in flags], dtype=object)
    order = [str(flag.name) for flag in CapFlag]
    counted = {name: int((first == name).sum()) for name in order}
    common = sorted((n for n in order if counted[n]), key=lambda n: -counted[n])[:FLAGGED]
    kinds = ["", *common, "other"]
    kind = np.array([kinds.index(w) if w in kinds else len(kinds) - 1 for w in first], dtype=int)
    labels = ["no flag", *(word.replace("_", " ") for word in common), "other flag"]
    present = [k for k in range(len(kinds)) if (kind == k).any()]
    names = tuple((f"{labels[k]} ({(kind == k).sum()})", FLAG_COLOUR[k]) for k in present)
    return Colouring("flag", np.searchsorted(present, kind).astype(float), names)


def cap_lines(view: View, i: int, load_share: float, force_share: float) -> list[str]:
    """Return what is known of one cap, and what it does in a state, a line each."""
    of = {name: column[i] for name, column in view.columns.items()}
    load_N = view.cap_load_N[i]
    lines = [
        f"cap {view.cap[i] + 1}" + (f", family {of['family']}" if of["family"] else ""),
        f"R = {engineering(of['radius_m'], 'm', 4)}, D = {engineering(of['diameter_m'], 'm')}",
        f"peak {engineering(of['peak_height_m'], 'm')}, df {engineering(of['cap_height_m'], 'm')}",
    ]
    if load_N > 0.0:
        share = f"{100.0 * view.cap_loss_share[i]:.2g} % of the loss"
        lines.append(f"{view.load_name} {engineering(load_N, 'N')}, {share}")
    contact_m = view.columns["contact_radius_m"][i]
    if np.isfinite(contact_m) and contact_m > 0.0:
        lines.append(f"contact radius {engineering(contact_m, 'm')}")
    lines.append(_doing(view, i, load_share, force_share))
    lines.append(of["flags"].replace("_", " ") or "no flags")
    return lines


def _doing(view: View, i: int, load_share: float, force_share: float) -> str:
    if view.zones is None:
        return "contacts not known"
    words = zone_at(view.zones, load_share, force_share).word[view.zones.cap == view.cap[i]]
    if not len(words):  # a contact is of the hill under its greatest pressure
        return "no contact of its own" if view.cap_load_N[i] > 0.0 else "touches nowhere"
    count = {word: int((words == word).sum()) for word in dict.fromkeys(words)}
    if len(words) == 1:
        return f"in the state shown: {words[0]}"
    return "contacts on it: " + ", ".join(f"{n} {word}" for word, n in count.items())


def cap_profiles(
    view: View, caps: Iterable[int]
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield a section along x through each cap: distance from the apex, height, fitted sphere [m].

    The rows are read from the file, so every point of them is there.
    """
    import h5py

    dy_m, dx_m = view.pixel_size_m
    with h5py.File(view.path) as file:
        for i in caps:
            of = {name: view.columns[name][i] for name in ("x_m", "y_m", "diameter_m", "radius_m")}
            row = int(np.clip(of["y_m"] // dy_m, 0, view.shape[0] - 1))
            reach_m = 0.85 * of["diameter_m"]
            first = int(np.clip((of["x_m"] - reach_m) // dx_m, 0, view.shape[1] - 1))
            last = int(np.clip((of["x_m"] + reach_m) // dx_m + 1, first + 1, view.shape[1]))
            height_m = file["surface/height_m"][row, first:last].astype(float)
            s_m = (np.arange(first, last) + 0.5) * dx_m - of["x_m"]
            R = of["radius_m"]
            inside = np.abs(s_m) <= min(R, 0.6 * of["diameter_m"])
            root_m = np.sqrt(np.where(inside, R**2 - s_m**2, 0.0))
            sphere_m = view.columns["peak_height_m"][i] - s_m**2 / (R + root_m)
            yield s_m, height_m, np.where(inside, sphere_m, np.nan)


def read_view(
    result: str | Path, max_cells: int = FACE_CELLS, summary: dict[str, Any] | None = None
) -> View:
    """Read what there is to be seen of a result.

    Parameters
    ----------
    result : path
        `result.h5`, or the folder that holds it.
    max_cells : int
        About how many cells the mesh of the face has at most.
    summary : dict, optional
        That of the result, where it is not yet in its folder.

    Raises
    ------
    OutputError
        If that is no result.
    """
    path = result_file(result)
    with _opened(path) as file:
        return _read(path, file, max_cells, summary)


EXPECTED = "expected the folder that `capslip analyze SCAN --out FOLDER` wrote, or its result.h5"


def result_file(result: str | Path) -> Path:
    """Return the `result.h5` of a folder, or of what lies beside it."""
    result = Path(result)
    path = result / "result.h5" if result.is_dir() else result
    if path.is_file() and path.suffix != ".h5" and path.with_name("result.h5").is_file():
        path = path.with_name("result.h5")  # the report, or the summary
    if result.is_dir() and not path.is_file() and (result / "summary.json").is_file():
        raise OutputError(
            f"{result}: a result without a face, as those of several scans and of families are; "
            f"{EXPECTED}, of one scan"
        )
    if not path.is_file():
        raise OutputError(f"{path}: no such file; {EXPECTED}")
    return path


def check_result(result: str | Path) -> bool:
    """Return whether a result knows single contacts; raise where there is no result.

    Raises
    ------
    OutputError
        As `read_view`.
    """
    path = result_file(result)
    with _opened(path) as file:
        _summary_beside(path)
        return "zones" in file


def _summary_beside(path: Path) -> dict[str, Any]:
    """Return what `summary.json` says of a result, nothing where there is none."""
    told = path.with_name("summary.json")
    found = read_json(told) if told.is_file() else {}
    if found is None:
        raise OutputError(f"{told}: damaged; expected the summary of the result; analyse again")
    return found


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    import h5py

    try:
        with h5py.File(path) as file:
            if "surface/height_m" not in file or "caps/radius_m" not in file:
                raise OutputError(f"{path}: an HDF5 file, but no result of an analysis; {EXPECTED}")
            yield file
    except PermissionError as error:
        raise OutputError(f"{path}: cannot be read (Permission denied)") from error
    except OSError as error:
        raise OutputError(f"{path}: no HDF5 file, or a damaged one; {EXPECTED}") from error


def _read(path: Path, file: Any, max_cells: int, summary: dict[str, Any] | None) -> View:
    height = file["surface/height_m"]
    shape = (int(height.shape[0]), int(height.shape[1]))
    dy_m, dx_m = (float(size) for size in height.attrs["pixel_size_m"])
    rows, cols = thinned_lines(shape, max_cells)
    zones = read_zones(file["zones"]) if "zones" in file else None
    pixel = np.zeros(0, dtype=np.int64) if zones is None else zones.pixel
    second = file["surface"].get("second_height_m")
    z_m, pixel_z_m = np.empty((len(rows), len(cols))), np.empty(len(pixel))
    lowest_m, highest_m = np.inf, -np.inf
    row, col = np.divmod(pixel, shape[1])
    for first, block_m in _blocks(height):
        here = (rows >= first) & (rows < first + len(block_m))
        z_m[here] = block_m[rows[here] - first][:, cols]
        at = (row >= first) & (row < first + len(block_m))
        pixel_z_m[at] = block_m[row[at] - first, col[at]]
        lowest_m = min(lowest_m, float(np.fmin.reduce(block_m, axis=None)))
        highest_m = max(highest_m, float(np.fmax.reduce(block_m, axis=None)))
    caps = file["caps"]
    usable = np.flatnonzero(np.isfinite(caps["radius_m"][:]))
    text = ("family", "flags")
    columns = {n: (caps[n].asstr() if n in text else caps[n])[:][usable] for n in CAP_COLUMNS}
    columns["contact_radius_m"] = caps["contact_radius_m"][:][usable]
    hill = file["hills"].get("load_N") if "hills" in file else None
    return View(
        path=path,
        summary=_summary_beside(path) if summary is None else summary,
        shape=shape,
        pixel_size_m=(dy_m, dx_m),
        y_m=(rows + 0.5) * dy_m,
        x_m=(cols + 0.5) * dx_m,
        height_m=z_m,
        second_m=None if second is None else from_nearest(second[rows][:, cols]),
        sz_m=highest_m - lowest_m,
        cap=usable,
        columns=columns,
        zones=zones,
        hill_N=None if hill is None else hill[:][usable],
        pixel_m=np.stack([(col + 0.5) * dx_m, (row + 0.5) * dy_m, pixel_z_m], axis=1),
    )


def _blocks(dataset: Any) -> Iterator[tuple[int, np.ndarray]]:
    """Yield rows of a map, with the number of the first, as many as fit."""
    chunk = dataset.chunks[0] if dataset.chunks else 1
    step = chunk * max(1, BLOCK // (chunk * dataset.shape[1]))
    for first in range(0, dataset.shape[0], step):
        yield first, dataset[first : first + step]


def round_limits(values: np.ndarray) -> tuple[float, float]:
    """Return a range with round ends that holds all but the utmost percent on either side.

    >>> round_limits(np.append(np.linspace(0.0, 9.3, 1000), 1e6))
    (0.0, 9.5)
    """
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = (float(edge) for edge in np.quantile(finite, [0.01, 0.99]))
    if finite.min() == 0.0:
        low = 0.0
    if not high > low:
        high = low + (abs(low) or 1.0)
    step = 0.5 * 10.0 ** np.floor(np.log10(high - low))
    low, high = step * np.floor(low / step + 1e-9), step * np.ceil(high / step - 1e-9)
    return float(f"{low:.12g}"), float(f"{high:.12g}")


def round_factor(factor: float) -> float:
    """Round down to half a digit, at least to 1: the same for every mesh of a face.

    >>> round_factor(6_834.0), round_factor(6_910.0), round_factor(0.3)
    (6500.0, 6500.0, 1.0)
    """
    digit = 0.5 * 10.0 ** np.floor(np.log10(factor))
    return max(1.0, float(np.floor(factor / digit) * digit))
