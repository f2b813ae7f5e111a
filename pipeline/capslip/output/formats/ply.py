"""PLY, binary, quadrilaterals with double coordinates: MeshLab, CloudCompare, Blender."""

from pathlib import Path

import numpy as np

from capslip.output.convert import Face, mesh_of


def write(face: Face, path: Path) -> None:
    """Write the face."""
    mesh = mesh_of(face)
    mesh.cells[0].data = mesh.cells[0].data.astype(np.int32)  # the widest that PLY has
    mesh.write(path, file_format="ply")
