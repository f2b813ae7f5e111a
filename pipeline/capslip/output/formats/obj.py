"""Wavefront OBJ, text, quadrilaterals."""

from pathlib import Path

from capslip.output.convert import Face, mesh_of


def write(face: Face, path: Path) -> None:
    """Write the face."""
    mesh_of(face).write(path, file_format="obj")
