"""XDMF in one file, text, quadrilaterals with `height_m` at the points: ParaView, FEniCS."""

from pathlib import Path

from capslip.output.convert import Face, mesh_of


def write(face: Face, path: Path) -> None:
    """Write the face."""
    mesh_of(face).write(path, file_format="xdmf", data_format="XML")
