"""The pixels of a pressed face that touch, each with each: what rough faces unload on.

Below a load the contact only shrinks. Where it is a few thousand pixels all over the map, patches
around them hold most of it, and a matrix between the pixels alone is far less work.
"""

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.half_space import love_kernel
from capslip.contact.solvers.patches import POINT_COST, PatchedFace

_MOST_PIXELS = 6000  # 300 MB


def pixels_alone(face: ElasticFace, contact: np.ndarray) -> PatchedFace | None:
    """Return a face of the pixels in contact alone, None where the whole map is no more work.

    Parameters
    ----------
    face : ElasticFace
        The whole map.
    contact : bool, shape (ny, nx)
        Where it touches.
    """
    parent = np.flatnonzero(contact)
    if len(parent) > _MOST_PIXELS or len(parent) ** 2 > POINT_COST * contact.size:
        return None
    row, column = np.unravel_index(parent, face.shape)
    dy_m, dx_m = face.pixel_size_m
    return PatchedFace(
        face.name,
        face.depth_m.reshape(-1)[parent],
        face.measured.reshape(-1)[parent],
        face.pixel_size_m,
        face.E_star_Pa,
        MatrixHalfSpace(row, column, face),  # type: ignore[arg-type]
        parent,
        face.shape,
        1,
        ((column + 0.5) * dx_m, (row + 0.5) * dy_m),
        hardness_Pa=face.hardness_Pa,
    )


class MatrixHalfSpace:
    """Sinking of a half-space under pressures on single pixels, as `HalfSpace` on a map."""

    def __init__(self, row: np.ndarray, column: np.ndarray, face: ElasticFace) -> None:
        quadrant = love_kernel(face.shape, face.pixel_size_m, face.E_star_Pa)
        offset = np.abs(row[:, None] - row) * face.shape[1] + np.abs(column[:, None] - column)
        self._matrix = quadrant.reshape(-1)[offset]  # m a pascal
        self._own_m_per_Pa = float(quadrant[0, 0])

    def sinking_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement into the half-space, shape (n,)."""
        return np.asarray(self._matrix @ pressure_Pa)

    def sinking_roughly_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the same: a single precision saves nothing here."""
        return self.sinking_m(pressure_Pa)

    def pressure_Pa(self, sinking_m: np.ndarray) -> np.ndarray:
        """Return roughly the pressure that makes a displacement: each pixel by itself."""
        return sinking_m / self._own_m_per_Pa
