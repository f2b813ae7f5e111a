"""Caps of two mated faces in one table."""

from dataclasses import fields

import numpy as np
import pytest

from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.caps.joining import join_faces
from capslip.caps.table import CapTable
from capslip.surface.heightmap import HeightMap
from capslip.surface.mating import place


def elliptic_face(angle):
    """One elliptic cap beside the middle of a face, flatter in the direction of the angle."""
    y, x = (np.mgrid[:140, :150] + 0.5) * 1e-4
    x, y = x - 7.9e-3, y - 6.6e-3
    along, across = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
    return HeightMap(-(along**2) / 80 - across**2 / 32, (1e-4, 1e-4))


@pytest.mark.parametrize("mirror", ["x", "y"])
@pytest.mark.parametrize(("angle", "rotation_rad"), [(0.4, 0.0), (0.4, 0.3), (-0.7, 1.1)])
def test_caps_of_the_second_face_lie_and_point_where_it_does(mirror, angle, rotation_rad):
    first, second = elliptic_face(0.2), elliptic_face(angle)
    one, other = (fit_caps(face, find_hills(face), "pinned") for face in (first, second))
    placement = place(first, second, mirror=mirror, rotation_rad=rotation_rad)
    joined = join_faces(one, other, placement.on_first, placement.rotation_rad)
    assert len(joined) == 2
    # a short way along the flatter direction, laid on the first face
    from_x, from_y = placement.on_first(other.x_m, other.y_m)
    to_x, to_y = placement.on_first(other.x_m + np.cos(angle), other.y_m + np.sin(angle))
    turned = np.arctan2(to_y - from_y, to_x - from_x)
    assert joined.x_m[1:] == pytest.approx(from_x, rel=1e-12)
    assert joined.y_m[1:] == pytest.approx(from_y, rel=1e-12)
    assert np.sin(joined.orientation_rad[1] - turned) == pytest.approx(0.0, abs=1e-6)
    assert 0.0 <= joined.orientation_rad[1] < np.pi


def test_all_else_stays_and_regions_keep_apart():
    face = elliptic_face(0.2)
    one = fit_caps(face, find_hills(face), "pinned")
    joined = join_faces(one, one, lambda x_m, y_m: (x_m, y_m), 0.0)
    assert joined.parent_region.tolist() == [1, 2]
    for field in fields(CapTable):
        if field.name not in ("parent_region", "orientation_rad"):
            both = getattr(joined, field.name)
            assert np.array_equal(both[:1], both[1:], equal_nan=both.dtype.kind == "f")
