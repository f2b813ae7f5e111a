"""STL, binary, triangles in single precision: CAD. It knows no unit; the numbers are metres."""

from pathlib import Path

from capslip.output.convert import Face, mesh_of


def write(face: Face, path: Path) -> None:
    """Write the face."""
    mesh_of(face, corners=3).write(path, file_format="stl", binary=True)
