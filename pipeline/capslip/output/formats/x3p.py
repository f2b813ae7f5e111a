"""X3P (ISO 25178-72): the height map itself, double precision."""

from pathlib import Path

from capslip.output.convert import Face

WHOLE = True


def write(face: Face, path: Path) -> None:
    """Write the face."""
    import x3pio

    dy_m, dx_m = face.pixel_size_m
    # Readers of other programs refuse a revision that they do not know
    revision = x3pio.Revision.ISO5436_2000
    x3pio.write(path, face.height_m, x_scale=dx_m, y_scale=dy_m, revision=revision)
