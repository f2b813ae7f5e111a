"""The face of a result as a file of another program, one format a file in `output/formats`.

Each holds a function `write(face, path)`. Coordinates are in metres and at true scale, x along the
columns and y along the rows, as in the result.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from capslip import registry
from capslip.disk import way_out, write_whole
from capslip.errors import OutputError, SettingsError, one_of
from capslip.output.mesh import grid_mesh
from capslip.output.view import View, read_view

if TYPE_CHECKING:
    import meshio

FOLDER = "output.formats"
MAX_CELLS = 4_000_000  # of a face; a mesh of more opens nowhere with ease


@dataclass(frozen=True, eq=False)
class Face:
    """The measured face, form removed; a thinned one has fewer rows and columns, as `y_m`, `x_m`.

    Attributes
    ----------
    height_m : ndarray, shape (ny, nx)
        NaN marks a non-measured point.
    y_m : ndarray, shape (ny,)
        Middles of the rows.
    x_m : ndarray, shape (nx,)
        Middles of the columns.
    pixel_size_m : (float, float)
        (dy, dx) of the whole map.
    label : ndarray, shape (ny, nx), optional
        Numbers of the hills, 0 elsewhere; for formats of the whole map.
    """

    height_m: np.ndarray
    y_m: np.ndarray
    x_m: np.ndarray
    pixel_size_m: tuple[float, float]
    label: np.ndarray | None = None


def export_result(
    result: str | Path, name: str, path: Path | None = None, max_cells: int = MAX_CELLS
) -> tuple[Path, str | None]:
    """Write the face of a result in a format of that name.

    Parameters
    ----------
    result : path
        The folder that an analysis wrote, or its `result.h5`.
    name : str
        A name in `output/formats`.
    path : Path, optional
        A new file; by default named after the folder, where the program was started.
    max_cells : int
        Formats of meshes leave out rows and columns of larger maps; no height is averaged.

    Returns
    -------
    path : Path
        The file.
    thinned : str or None
        What was left out, in words; None where every point is there.

    Raises
    ------
    OutputError
        If that is no result, no point of it makes a face, or the file exists or cannot be written.
    SettingsError
        If there is no such format.
    """
    known = registry.names(FOLDER)
    if name not in known:
        raise SettingsError(f"--to: got {name}; {one_of(known, name)}")
    form = registry.entry(FOLDER, name)
    whole = getattr(form, "WHOLE", False)  # a format that has no meaning with lines left out
    view = read_view(result, max_cells=np.iinfo(np.int64).max if whole else max_cells)
    path = path or Path(f"{view.path.absolute().parent.name}.{name}")
    refuse_file(path, name)
    label = _labels(view.path) if whole else None
    face = Face(view.height_m, view.y_m, view.x_m, view.pixel_size_m, label)
    write = cast(Callable[[Face, Path], None], form.write)
    try:
        write_whole(path, lambda unfinished: write(face, unfinished))
    except OSError as error:
        step = way_out(error, "give another name")
        raise OutputError(f"{path}: {error.strerror or error}; {step}") from error
    return path, _left_out(view)


def refuse_file(path: Path, suffix: str) -> None:
    """Refuse a new file that has another suffix or no folder, or exists (OutputError)."""
    if path.suffix.lower() != f".{suffix}":
        raise OutputError(f"{path}: got {path.suffix or 'no suffix'}; expected .{suffix}")
    if path.exists():
        raise OutputError(f"{path}: exists already; nothing was written; give another with --out")
    if not path.absolute().parent.is_dir():
        raise OutputError(f"{path}: no such folder; make it, or give another with --out")


def mesh_of(face: Face, corners: int = 4) -> "meshio.Mesh":
    """Join the measured points to cells of four or three corners, their normals out of the face."""
    import meshio

    points, cells = grid_mesh(face.height_m, face.y_m, face.x_m)
    if not len(cells):
        raise OutputError("no four neighbouring points are measured; there is no face to write")
    if corners == 4:
        return meshio.Mesh(points, {"quad": cells}, point_data={"height_m": points[:, 2].copy()})
    return meshio.Mesh(points, {"triangle": cells[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)})


def _labels(result: Path) -> np.ndarray:
    import h5py

    with h5py.File(result) as file:
        label: np.ndarray = file["hills/labels"][:].astype(np.int32)
    return label


def _left_out(view: View) -> str | None:
    if view.height_m.shape == view.shape:
        return None
    kept, all_of_them = (" x ".join(map(str, shape)) for shape in (view.height_m.shape, view.shape))
    return f"{kept} of {all_of_them} points were written, rows and columns between them left out"
