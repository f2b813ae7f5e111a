"""X3P (ISO 25178-72): the height map itself, double precision."""

from pathlib import Path

from capslip.output.convert import Face

WHOLE = True


def write(face: Face, path: Path) -> None:
    """Write the face."""
    import x3pio

    dy_m, dx_m = face.pixel_size_m
    x3pio.write(path, face.height_m, x_scale=dx_m, y_scale=dy_m)
