"""Meshes of the face and of the fitted caps, for ParaView and for finite-element codes."""

import base64
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from capslip.result import Analysis

FACE_CELLS = 240_000
CAP_CELLS = 200_000
BLOCK = 1 << 18  # bytes that are packed at a time
VTU_TYPES = {("f", 4): ("<f4", "Float32"), ("f", 8): ("<f8", "Float64")}
VTU_TYPES |= {("i", 4): ("<i4", "Int32"), ("i", 8): ("<i8", "Int64")}
VTU_CELL = {3: 5, 4: 9}  # corners: triangle, quadrilateral
FAMILY_CODE = {"": 0, "P": 1, "G": 2}


def face_mesh(
    height_m: np.ndarray, pixel_size_m: tuple[float, float], max_cells: int = FACE_CELLS
) -> tuple[np.ndarray, np.ndarray]:
    """Join the points of a height map to quadrilaterals.

    Parameters
    ----------
    height_m : ndarray, shape (ny, nx)
        Heights; NaN marks a non-measured point.
    pixel_size_m : (float, float)
        (dy, dx).
    max_cells : int
        About how many cells to make at most. A larger map is thinned: rows and columns are left
        out, no height is averaged, and the outermost rows and columns stay.

    Returns
    -------
    points : ndarray, shape (n_points, 3)
        x, y, z in metres, of the measured points that a cell uses.
    cells : int ndarray, shape (n_cells, 4)
        Numbers of the corners. A quadrilateral with a non-measured corner is left out; a hole that
        lies between the remaining rows and columns is bridged.

    Examples
    --------
    >>> points, cells = face_mesh(np.zeros((3, 4)), (1e-3, 2e-3))
    >>> points.shape, cells.shape
    ((12, 3), (6, 4))
    """
    rows, cols = thinned_lines(height_m.shape, max_cells)
    dy_m, dx_m = pixel_size_m
    return grid_mesh(height_m[np.ix_(rows, cols)], (rows + 0.5) * dy_m, (cols + 0.5) * dx_m)


def thinned_lines(shape: tuple[int, ...], max_cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of the rows and columns of a map that a mesh of so many cells keeps."""
    step = max(1, int(np.ceil(np.sqrt(shape[0] * shape[1] / max_cells))))
    rows, cols = (_thinned(n, step) for n in shape)
    return rows, cols


def grid_mesh(z_m: np.ndarray, y_m: np.ndarray, x_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Join heights (ny, nx) over rows at y_m and columns at x_m to quadrilaterals.

    Points and cells are those of `face_mesh`.
    """
    corners = [np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, 1:], np.s_[1:, :-1]]
    measured = np.isfinite(z_m)
    whole = np.logical_and.reduce([measured[corner] for corner in corners])
    used = np.zeros(z_m.shape, dtype=bool)
    for corner in corners:
        used[corner] |= whole
    number = np.cumsum(used).reshape(z_m.shape) - 1
    x_m, y_m = np.meshgrid(x_m, y_m)
    points = np.stack([x_m[used], y_m[used], z_m[used]], axis=1)
    return points, np.stack([number[corner][whole] for corner in corners], axis=1)


def cap_mesh(
    x_m: np.ndarray,
    y_m: np.ndarray,
    peak_height_m: np.ndarray,
    cap_height_m: np.ndarray,
    diameter_m: np.ndarray,
    max_cells: int = CAP_CELLS,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangulate spherical caps from the apex down to the cut.

    Parameters
    ----------
    x_m, y_m, peak_height_m : ndarray, shape (n,)
        Apex.
    cap_height_m, diameter_m : ndarray, shape (n,)
        df and D of Eq. 18, both positive.
    max_cells : int
        Caps get coarser to keep to this number, down to six triangles a cap.

    Returns
    -------
    points : ndarray, shape (n_points, 3)
        x, y, z in metres; each lies on its sphere.
    cells : int ndarray, shape (n_cells, 3)
        Numbers of the corners.
    cap : int ndarray, shape (n_points,)
        Which of the n caps a point belongs to; caps share no point.

    Examples
    --------
    >>> one = np.ones(1)
    >>> points, _, _ = cap_mesh(0 * one, 0 * one, 5e-6 * one, 2e-6 * one, 1e-2 * one)
    >>> np.round([points[:, 2].max() * 1e6, points[:, 2].min() * 1e6], 9)
    array([5., 3.])
    """
    n = len(x_m)
    sectors = int(np.clip(np.sqrt(2 * max_cells / max(n, 1)), 6, 48))
    rings = max(1, sectors // 4)
    around = np.linspace(0.0, 2 * np.pi, sectors, endpoint=False)
    share = np.arange(1, rings + 1) / rings
    u = np.append(0.0, np.tile(np.cos(around), rings))
    v = np.append(0.0, np.tile(np.sin(around), rings))

    # By the polar angle: no cancellation in a flat cap, and right beyond the equator as well.
    half_m = diameter_m[:, None] / 2
    radius_m = (half_m**2 / cap_height_m[:, None] + cap_height_m[:, None]) / 2  # Eq. 18
    rim = 2.0 * np.arctan2(cap_height_m[:, None], half_m)
    polar = rim * np.append(0.0, np.repeat(share, sectors))
    r_m, sag_m = radius_m * np.sin(polar), 2.0 * radius_m * np.sin(polar / 2) ** 2
    points = np.stack(
        [x_m[:, None] + r_m * u, y_m[:, None] + r_m * v, peak_height_m[:, None] - sag_m], 2
    ).reshape(-1, 3)
    one_cap = _disc_triangles(rings, sectors)
    cells = (one_cap + len(u) * np.arange(n)[:, None, None]).reshape(-1, 3)
    return points, cells, np.repeat(np.arange(n), len(u))


def segment_mesh(
    apex_m: np.ndarray,
    radius_m: np.ndarray,
    inner_m: np.ndarray,
    outer_m: np.ndarray,
    side_m: tuple[float, float],
    max_cells: int = CAP_CELLS,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangulate rings of spheres around their apex, as far as the face goes.

    Parameters
    ----------
    apex_m : ndarray, shape (n, 3)
        Apex of each sphere.
    radius_m : ndarray, shape (n,)
        Its radius.
    inner_m, outer_m : ndarray, shape (n,)
        Distances from the apex, along the face, between which the ring lies; at most the radius.
    side_m : (float, float)
        Sides (y, x) of the face; a ring ends at its edge.
    max_cells : int
        Rings get coarser to keep to this number.

    Returns
    -------
    points, cells, ring
        As of `cap_mesh`: places, corners of the triangles, and the ring each point belongs to.

    Examples
    --------
    >>> one = np.ones(1)
    >>> points, _, _ = segment_mesh(np.zeros((1, 3)), 2 * one, 0 * one, one, (4.0, 4.0))
    >>> print(points.min(axis=0))  # the apex is a corner of the face
    [ 0.          0.         -0.26794919]
    """
    n = len(radius_m)
    sectors = int(np.clip(np.sqrt(2 * max_cells / max(n, 1)), 8, 48))
    steps = max(1, sectors // 8)
    around = np.linspace(0.0, 2 * np.pi, sectors, endpoint=False)
    u, v = np.cos(around), np.sin(around)
    x_m, y_m = (apex_m[:, i, None] for i in (0, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        to_x = np.where(u > 0, (side_m[1] - x_m) / u, np.where(u < 0, -x_m / u, np.inf))
        to_y = np.where(v > 0, (side_m[0] - y_m) / v, np.where(v < 0, -y_m / v, np.inf))
    edge_m = np.maximum(np.minimum(to_x, to_y), 0.0)[:, None, :]
    share = np.linspace(0.0, 1.0, steps + 1)[:, None]
    r_m = inner_m[:, None, None] + share * (outer_m - inner_m)[:, None, None]
    r_m = np.minimum(np.broadcast_to(r_m, (n, steps + 1, sectors)), edge_m)
    R = radius_m[:, None, None]
    sag_m = r_m**2 / (R + np.sqrt(np.maximum(R**2 - r_m**2, 0.0)))
    places = (x_m[:, None] + r_m * u, y_m[:, None] + r_m * v, apex_m[:, 2, None, None] - sag_m)
    points = np.stack(places, axis=-1).reshape(-1, 3)
    here = np.arange(sectors)
    following = (here + 1) % sectors
    one = []
    for step in range(steps):
        low, high = step * sectors, (step + 1) * sectors
        one.append(np.stack([here + low, here + high, following + high], axis=1))
        one.append(np.stack([here + low, following + high, following + low], axis=1))
    of_ring = sectors * (steps + 1)
    cells = (np.concatenate(one) + of_ring * np.arange(n)[:, None, None]).reshape(-1, 3)
    return points, cells, np.repeat(np.arange(n), of_ring)


def write_meshes(analysis: "Analysis", folder: str | Path) -> list[Path]:
    """Write `surface.vtu` and, where there are caps, `caps.vtu`.

    Coordinates and values are SI, at true scale: 1 um of relief on 60 mm. `caps.vtu` holds cap
    (the row of `caps.csv`, from 1), family (0 none, 1 P, 2 G), radius_m, load_N and
    peak_height_m of each cap on its cells and points.

    Parameters
    ----------
    analysis : Analysis
        A finished analysis.
    folder : path
        An existing folder.

    Returns
    -------
    list of Path
        The files written.
    """
    folder = Path(folder)
    surface = analysis.conditioned.surface
    points, cells = face_mesh(surface.height_m, surface.pixel_size_m)
    paths = []
    if len(cells):
        points = points.astype(np.float32)  # as in `result.h5`
        paths.append(folder / "surface.vtu")
        _write_vtu(paths[-1], points, cells, {"height_m": points[:, 2]}, {})

    caps = analysis.caps
    usable = np.flatnonzero(caps.usable)
    if len(usable):
        points, cells, cap = cap_mesh(
            caps.x_m[usable],
            caps.y_m[usable],
            caps.peak_height_m[usable],
            caps.cap_height_m[usable],
            caps.diameter_m[usable],
        )
        columns = {
            "cap": usable + 1,
            "family": np.array([FAMILY_CODE[name] for name in caps.family[usable]]),
            "radius_m": caps.radius_m[usable],
            "load_N": caps.load_N[usable],
            "peak_height_m": caps.peak_height_m[usable],
        }
        on_points = {name: column[cap] for name, column in columns.items()}
        on_cells = {name: column[cap[cells[:, 0]]] for name, column in columns.items()}
        paths.append(folder / "caps.vtu")
        _write_vtu(paths[-1], points, cells, on_points | {"height_m": points[:, 2]}, on_cells)
    return paths


def _write_vtu(
    path: Path,
    points: np.ndarray,
    cells: np.ndarray,
    on_points: dict[str, np.ndarray],
    on_cells: dict[str, np.ndarray],
) -> None:
    """Write cells of three or four corners each, packed quickly (meshio takes five times as long).

    Source: "VTK XML formats", docs.vtk.org: binary data in line, in blocks packed by zlib.
    """

    def array(name: str, values: np.ndarray) -> str:
        values = values.astype(VTU_TYPES[values.dtype.kind, values.dtype.itemsize][0], copy=False)
        data = np.ascontiguousarray(values).data.cast("B")
        blocks = [zlib.compress(data[i : i + BLOCK], 1) for i in range(0, len(data), BLOCK)]
        sizes = [len(blocks), BLOCK, len(data) % BLOCK, *map(len, blocks)]
        head, body = np.array(sizes, dtype="<u4").tobytes(), b"".join(blocks)
        text = base64.b64encode(head) + base64.b64encode(body)
        kind = VTU_TYPES[values.dtype.kind, values.dtype.itemsize][1]
        width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
        begin = f'<DataArray type="{kind}" Name="{name}"{width} format="binary">'
        return f"{begin}{text.decode('ascii')}</DataArray>\n"

    n, corners = cells.shape
    topology = {
        "connectivity": cells.astype(np.int32).ravel(),
        "offsets": corners * np.arange(1, n + 1, dtype=np.int32),
        "types": np.full(n, VTU_CELL[corners], dtype=np.int32),
    }
    parts = {
        "Points": {"Points": points},
        "Cells": topology,
        "PointData": on_points,
        "CellData": on_cells,
    }
    with path.open("w", encoding="ascii") as file:
        file.write(
            '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" '
            'byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor">\n'
            f'<UnstructuredGrid><Piece NumberOfPoints="{len(points)}" NumberOfCells="{n}">\n'
        )
        for part, arrays in parts.items():
            body = "".join(array(name, values) for name, values in arrays.items())
            file.write(f"<{part}>\n{body}</{part}>\n")
        file.write("</Piece></UnstructuredGrid></VTKFile>\n")


def _thinned(n: int, step: int) -> np.ndarray:
    """Choose about every step-th of n indices, the first and the last among them."""
    return np.unique(np.rint(np.linspace(0, n - 1, (n - 1) // step + 1 + (step > 1))).astype(int))


def _disc_triangles(rings: int, sectors: int) -> np.ndarray:
    """Triangles of a disc: point 0 in the middle, then ring after ring; normals point up."""
    here = 1 + np.arange(sectors)
    following = 1 + (np.arange(sectors) + 1) % sectors
    triangles = [np.stack([np.zeros_like(here), here, following], axis=1)]
    for ring in range(rings - 1):
        inner, outer = ring * sectors, (ring + 1) * sectors
        triangles.append(np.stack([here + inner, here + outer, following + outer], axis=1))
        triangles.append(np.stack([here + inner, following + outer, following + inner], axis=1))
    return np.concatenate(triangles)
