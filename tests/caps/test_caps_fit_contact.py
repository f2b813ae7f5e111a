"""Caps as contact wants them: elliptic caps, caps at the edge, and the depth of compression."""

import json
from dataclasses import replace

import numpy as np
import pytest

from capslip.caps.fit import fit_caps
from capslip.caps.fitting import fit_named
from capslip.caps.hills import find_hills
from capslip.caps.points import points_of_hills
from capslip.caps.spheres import edge_factor, elliptic_factor
from capslip.caps.table import CapFlag
from capslip.contact.bulk import bulk_compliance_m_per_N
from capslip.contact.models.interacting import interacting
from capslip.contact.slip import slip_curve
from capslip.surface.heightmap import HeightMap
from scenes import REFERENCE, caps_map

CONTACT_SHARE = fit_named("contact").compression_share


def exact_elliptic_factor(axis_ratio):
    """R1 / R2 and the radius of the equivalent sphere over sqrt(R1 R2), Johnson 1985, Sec. 4.2.

    At the given ratio b / a of the axes of the contact.
    """
    from scipy.special import ellipe, ellipk

    e2 = 1 - axis_ratio**2
    K, E = ellipk(e2), ellipe(e2)
    A, B = E / axis_ratio**2 - K, K - E
    F1_cubed = 4 / (np.pi * e2) * axis_ratio**1.5 * np.sqrt(A * B)
    F2 = 2 / np.pi * np.sqrt(axis_ratio) * F1_cubed ** (-1 / 3) * K
    return A / B, F2**-3


@pytest.mark.parametrize("axis_ratio", [0.99, 0.9, 0.7, 0.5, 0.3, 0.15, 0.05, 0.02])
def test_elliptic_factor_is_that_of_the_elliptic_integrals(axis_ratio):
    radius_ratio, factor = exact_elliptic_factor(axis_ratio)
    assert radius_ratio < 1000
    assert elliptic_factor(radius_ratio) == pytest.approx(factor, rel=4e-4)
    assert elliptic_factor(1 / radius_ratio) == pytest.approx(factor, rel=4e-4)


@pytest.mark.parametrize("pixel_size_m", [(1e-4, 1e-4), (0.7e-4, 1.3e-4)])
@pytest.mark.parametrize("angle", [0.0, 0.4, 1.2, -0.7])
@pytest.mark.parametrize("fit", ["pinned", "least_squares", "contact"])
def test_an_elliptic_cap_has_its_radii_and_direction(fit, angle, pixel_size_m):
    flat_m, steep_m = 40.0, 16.0
    y, x = (np.mgrid[:140, :150] + 0.5) * np.array(pixel_size_m)[:, None, None]
    x, y = x - x.mean() - 3e-5, y - y.mean() + 2e-5
    along, across = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
    height_m = -(along**2) / (2 * flat_m) - across**2 / (2 * steep_m)
    surface = HeightMap(height_m, pixel_size_m)
    table = fit_caps(surface, find_hills(surface), fit)
    assert len(table) == 1
    assert table.flags[0] == 0
    assert table.radius_major_m[0] == pytest.approx(flat_m, rel=1e-6)
    assert table.radius_minor_m[0] == pytest.approx(steep_m, rel=1e-6)
    assert table.orientation_rad[0] == pytest.approx(angle, abs=1e-6)
    assert table.peak_height_m[0] == pytest.approx(0.0, abs=1e-13)
    radius_m = np.sqrt(flat_m * steep_m) * elliptic_factor(flat_m / steep_m)
    assert table.radius_m[0] == pytest.approx(radius_m, rel=0.005)


# A sphere of 25 m whose apex lies `from_edge` times 0.59 mm inside the edge, or both edges of a
# corner, under the load that makes that its contact radius away from edges (a third of it where
# the apex lies outside): radius of the sphere that yields as much, over 25 m, by boundary elements.
AT_EDGE = [
    (-0.5, 0.348),
    (-0.2, 0.459),
    (0.0, 0.600),
    (0.2, 0.734),
    (0.4, 0.854),
    (0.6, 0.941),
    (1.2, 1.000),
]
IN_CORNER = [
    (-0.5, 0.101),
    (-0.2, 0.182),
    (0.0, 0.316),
    (0.2, 0.485),
    (0.4, 0.685),
    (0.6, 0.869),
    (1.2, 1.000),
]


@pytest.mark.parametrize(
    ("from_edge", "expected", "corner"),
    [(*row, False) for row in AT_EDGE] + [(*row, True) for row in IN_CORNER],
)
def test_a_cap_at_the_edge_of_the_face_loads_like_the_sphere_it_gets(from_edge, expected, corner):
    a_m, pixel_m, R = 5.9e-4, 2e-5, 25.0
    N_over_E = 4 / 3 * a_m**3 / R / (3 if from_edge < 0 else 1)
    approach_m = (N_over_E / (4 / 3 * np.sqrt(R * expected))) ** (2 / 3)
    place_m = from_edge * a_m
    y, x = (np.mgrid[:160, :160] + 0.5) * pixel_m
    height_m = -((x - place_m) ** 2 + (y - (place_m if corner else 1.6e-3)) ** 2) / (2 * R)
    surface = HeightMap(height_m, (pixel_m, pixel_m))
    table = fit_caps(
        surface, find_hills(surface, 0.3), "contact", np.array([CONTACT_SHARE * approach_m])
    )
    assert table.radius_m[0] == pytest.approx(expected * R, rel=0.05 if corner else 0.015)
    # the others take the edge as the end of the measurement
    pinned = fit_caps(surface, find_hills(surface, 0.3), "pinned", np.array([approach_m / 2]))
    assert pinned.radius_m[0] == pytest.approx(R, rel=0.01)


def left_of_paraboloid(at, corner):
    """Share of the volume below 1 - x^2 - y^2 at x < `at`; in a corner at y < `at` too."""
    x = (np.arange(2000) + 0.5) / 1000 - 1
    height = np.maximum(1 - x**2 - x[:, None] ** 2, 0.0)
    here = (x < at) & ((x[:, None] < at) | (not corner))
    return height[here].sum() / height.sum()


@pytest.mark.parametrize("corner", [False, True])
@pytest.mark.parametrize("i", range(len(AT_EDGE)))
def test_the_edge_factor_makes_the_volume_load_like_the_boundary_elements(i, corner):
    """The fit is at half of the compression, so its lengths follow from the load of the table."""
    at, expected = (IN_CORNER if corner else AT_EDGE)[i]
    place = at * expected ** (1 / 6) * (3 ** (1 / 3) if at < 0 else 1)  # over sqrt(2 R depth)
    none, away = np.zeros((2, 1)), np.ones((2, 1))
    axes = 2 if corner else 1
    if at < 0:  # the whole cap is deeper than what is there
        depth = 1 + axes * place**2
        volume = depth**2 * left_of_paraboloid(place / np.sqrt(depth), corner)
        inside, outside = none, none - place
    else:
        volume = left_of_paraboloid(place, corner)
        inside, outside = none + place / np.sqrt(volume), none
    if not corner:
        inside, outside = np.vstack([inside[:1], away[:1]]), np.vstack([outside[:1], none[:1]])
    factor = edge_factor(inside, outside)[0]
    within = 0.015 if corner or at < 0 else 0.003
    assert factor * volume == pytest.approx(expected, abs=within)


def test_the_edge_factor_has_the_values_of_its_fit():
    inside = np.array([[1.0, 0.5, 0.5, 0.0, 0.0, 0.0], [1.5, 1.0, 0.5, 1.0, 1.0, 1.0]])
    outside = np.array([[0.0, 0.0, 0.0, 0.5, 1.0, 3.0], [0.0] * 6])
    expected = [1.0, 1.0435275, 1.0615572, 1.48, 1.76, 1.76]
    assert edge_factor(inside, outside) == pytest.approx(expected, abs=1e-6)
    assert edge_factor(inside[::-1], outside[::-1]) == pytest.approx(expected, abs=1e-6)


def test_the_depth_asked_for_is_used_where_the_hill_has_it():
    surface = caps_map([(6e-3, 5e-3, 24.0, 0.0), (14e-3, 12e-3, 27.0, -1e-7)])
    hills = find_hills(surface)
    height_m = fit_caps(surface, hills, "contact").cap_height_m
    asked_m = np.array([0.3 * height_m[0], np.nan])
    table = fit_caps(surface, hills, "contact", asked_m)
    assert table.fit_depth_m == pytest.approx([0.3 * height_m[0], 0.5 * height_m[1]])
    deep = fit_caps(surface, hills, "contact", 10 * height_m)
    assert deep.fit_depth_m == pytest.approx(height_m)
    shallow = fit_caps(surface, hills, "contact", 1e-6 * height_m)
    assert (shallow.fit_depth_m > 1e-3 * height_m).all()
    assert shallow.radius_m == pytest.approx(table.radius_m, rel=0.05)


def test_points_gathered_before_change_nothing():
    surface = caps_map([(6e-3, 5e-3, 24.0, 0.0), (14e-3, 12e-3, 27.0, -1e-7)])
    hills = find_hills(surface)
    here = fit_caps(surface, hills, "contact")
    there = fit_caps(surface, hills, "contact", points=points_of_hills(surface, hills))
    for name, column in here.columns().items():
        assert np.array_equal(column, there.columns()[name], equal_nan=column.dtype.kind == "f")


def wheel(surface, preload_N, E_star_Pa):
    """Fit each cap at the depth at which the interacting contact compresses it."""
    hills = find_hills(surface)
    caps = fit_caps(surface, hills, "contact")
    for _ in range(6):
        peak_m = caps.peak_height_m
        curve = interacting(caps.radius_m, peak_m.max() - peak_m, caps.x_m, caps.y_m, E_star_Pa)
        load_N = curve.asperity_loads_N(curve.approach_m(preload_N))
        compression_m = (3 * load_N / (4 * E_star_Pa * np.sqrt(caps.radius_m))) ** (2 / 3)
        depth_m = np.where(load_N > 0, CONTACT_SHARE * compression_m, np.nan)
        caps = fit_caps(surface, hills, "contact", depth_m)
    return caps, curve


@pytest.mark.skipif(not REFERENCE.is_dir(), reason="the reference faces are not beside the project")
@pytest.mark.parametrize("name", ["caps", "wavy"])
def test_caps_fitted_at_their_compression_meet_the_boundary_elements(name):
    import h5py

    truth = json.loads((REFERENCE / "truth.json").read_text())[name]
    with h5py.File(REFERENCE / f"{name}.h5") as file:
        surface = HeightMap(file["height"][:], file["height"].attrs["pixel_size"] * 1e-4 / 1e-4)
    preload_N, E_star_Pa = truth["preload_N"], truth["E_star_Pa"]
    caps, curve = wheel(surface, preload_N, E_star_Pa)
    above_m = surface.height_m.max() - caps.peak_height_m.max()
    bulk_m = preload_N * bulk_compliance_m_per_N(surface.side_m, E_star_Pa)
    approach_m = curve.approach_m(preload_N) + above_m - bulk_m
    assert approach_m == pytest.approx(truth["approach_m"] - bulk_m, rel=0.03)
    nu = truth["poisson_ratio"]
    slip = slip_curve(curve, preload_N, truth["friction_coefficient"], (2 - nu) / (2 - 2 * nu))
    for point in truth["slip"][1:]:
        assert slip.energy_at_force_J(point["force_N"]) == pytest.approx(point["energy_J"], rel=0.1)


def test_a_cap_away_from_the_edge_is_the_same_by_pinned_and_contact():
    surface = caps_map([(6e-3, 5e-3, 24.0, 0.0), (14e-3, 12e-3, 27.0, -1e-7)])
    hills = find_hills(surface)
    pinned, contact = fit_caps(surface, hills, "pinned"), fit_caps(surface, hills, "contact")
    assert np.array_equal(pinned.radius_m, contact.radius_m)
    assert ((contact.flags & CapFlag.edge) == 0).all()
    assert replace(contact).columns().keys() == pinned.columns().keys()


def around(height_m, rows, columns):
    """Return the heights within a frame of so many lines before and behind, not measured."""
    return np.pad(height_m, (rows, columns), constant_values=np.nan)


@pytest.mark.parametrize("fit", ["contact", "pinned", "least_squares"])
@pytest.mark.parametrize(
    ("at", "rows", "columns"),
    [
        ((0.3, 0.0), (0, 0), (3, 0)),
        ((-0.2, 0.0), (2, 5), (9, 1)),  # the apex of the whole cap lies outside
        ((0.2, 0.1), (4, 0), (1, 6)),  # in a corner
    ],
)
def test_a_cap_at_the_end_of_a_face_is_that_of_the_map_that_ends_there(at, rows, columns, fit):
    pixel_m, R, noise = 2e-5, 25.0, np.random.default_rng(2).normal(0.0, 1e-11, (160, 160))
    y, x = (np.mgrid[:160, :160] + 0.5) * pixel_m
    y_m = at[1] * 5.9e-4 if at[1] else 1.6e-3
    height_m = noise - ((x - at[0] * 5.9e-4) ** 2 + (y - y_m) ** 2) / (2 * R)
    for turn in (np.s_[:, :], np.s_[::-1, ::-1]):
        tables = []
        for one_m in (height_m[turn], around(height_m[turn], rows, columns)):
            surface = HeightMap(np.ascontiguousarray(one_m), (pixel_m, pixel_m))
            tables.append(fit_caps(surface, find_hills(surface, 0.3), fit, np.array([7e-9])))
        whole, within = tables
        assert (whole.flags & CapFlag.edge).all()
        assert np.array_equal(whole.flags, within.flags)
        assert within.radius_m == pytest.approx(whole.radius_m, rel=1e-9)
        assert within.peak_height_m == pytest.approx(whole.peak_height_m, rel=1e-9, abs=1e-15)
        assert within.x_m == pytest.approx(whole.x_m + columns[0] * pixel_m, rel=1e-9)
        assert within.y_m == pytest.approx(whole.y_m + rows[0] * pixel_m, rel=1e-9)


@pytest.mark.parametrize(("from_edge", "expected"), [(0.0, 0.600), (0.4, 0.854)])
def test_a_cap_at_a_hole_loads_like_one_at_the_edge_where_nothing_is_in_it(from_edge, expected):
    """A hole of 1.2 mm at whose side the apex lies, or 0.4 contact radii beside it."""
    a_m, pixel_m, R = 5.9e-4, 2e-5, 25.0
    approach_m = (a_m**3 / R / np.sqrt(R * expected)) ** (2 / 3)
    y, x = (np.mgrid[:160, :240] + 0.5) * pixel_m - np.array([1.6e-3, 1.8e-3])[:, None, None]
    hole = (np.abs(y) < 1.5e-3) & (x < -from_edge * a_m) & (x > -from_edge * a_m - 1.2e-3)
    height_m = np.where(hole, np.nan, -(x**2 + y**2) / (2 * R))
    surface, depth_m = HeightMap(height_m, (pixel_m, pixel_m)), CONTACT_SHARE * approach_m
    given = find_hills(surface, 0.2), "contact", np.array([depth_m])
    unknown, void = fit_caps(surface, *given), fit_caps(surface.as_void(), *given)
    assert unknown.radius_m[0] == pytest.approx(R, rel=0.01)  # nobody knows: it goes on
    assert void.radius_m[0] == pytest.approx(expected * R, rel=0.02)
    assert CapFlag.edge in CapFlag(int(void.flags[0]))
    assert CapFlag.non_measured in CapFlag(int(unknown.flags[0]))
