"""Meshes as `.vtu`: the XML files of unstructured grids that ParaView reads."""

import sys
import zlib
from base64 import b64encode
from pathlib import Path

import numpy as np

LEVEL = 1  # of compression: the files of level 6 are as large and take four times as long
BLOCK_BYTES = 2**15  # that are compressed at a time
VTK_CELL = {3: 5, 4: 9}  # by its corners: triangle, quadrilateral
VTK_TYPE = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}


def write_vtu(
    path: Path,
    points_m: np.ndarray,
    cells: np.ndarray,
    on_points: dict[str, np.ndarray],
    on_cells: dict[str, np.ndarray],
) -> None:
    """Write a mesh of triangles or of quadrilaterals.

    Parameters
    ----------
    path : Path
        The file.
    points_m : float64, shape (n_points, 3)
        x, y, z.
    cells : int64, shape (n_cells, 3 or 4)
        Numbers of the corners.
    on_points, on_cells : dict of float64 or int64, shape (n_points,) or (n_cells,)
        What is known of each, by name.
    """
    n, corners = cells.shape
    ends = np.arange(corners, corners * (n + 1), corners)
    kinds = np.full(n, VTK_CELL[corners], dtype=np.uint8)
    shape = {"connectivity": cells.reshape(-1), "offsets": ends, "types": kinds}
    order = f"{sys.byteorder.capitalize()}Endian"
    head = f'type="UnstructuredGrid" version="0.1" byte_order="{order}" header_type="UInt32"'
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(f'<?xml version="1.0"?>\n<VTKFile {head} compressor="vtkZLibDataCompressor">\n')
        file.write("<UnstructuredGrid>\n")
        file.write(f'<Piece NumberOfPoints="{len(points_m)}" NumberOfCells="{n}">\n')
        parts = {"Points": {"Points": points_m}, "Cells": shape}
        parts |= {"PointData": on_points, "CellData": on_cells}
        for name, arrays in parts.items():
            file.write(f"<{name}>\n{''.join(map(_array, arrays, arrays.values()))}</{name}>\n")
        file.write("</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")


def _array(name: str, values: np.ndarray) -> str:
    """Return one array: the sizes of its blocks, and the blocks, each in base 64."""
    whole = np.ascontiguousarray(values).tobytes()
    blocks = [whole[at : at + BLOCK_BYTES] for at in range(0, len(whole), BLOCK_BYTES)]
    packed = [zlib.compress(block, LEVEL) for block in blocks]
    last = len(blocks[-1]) if blocks else 0
    sizes = np.array([len(blocks), BLOCK_BYTES, last, *map(len, packed)], dtype=np.uint32)
    kind = f'type="{VTK_TYPE[values.dtype.str[1:]]}" Name="{name}"'
    columns = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    text = (b64encode(sizes.tobytes()) + b64encode(b"".join(packed))).decode()
    return f'<DataArray {kind}{columns} format="binary">\n{text}\n</DataArray>\n'
