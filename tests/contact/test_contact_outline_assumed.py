"""What was not measured at the edge of a map: said where hills of the face may have stood there."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.analysis import analyze_once
from capslip.contact import bulk
from capslip.contact.bulk import bulk_compliance_m_per_N, bulk_of_face_m_per_N, filled_outside
from capslip.settings import load_settings
from capslip.surface.heightmap import HeightMap
from capslip.surface.holes import outside_as_made
from scenes import caps_map

SHAPE, PIXEL_M = (160, 240), 2e-4
Y_M, X_M = (np.mgrid[: SHAPE[0], : SHAPE[1]] + 0.5) * PIXEL_M
MIDDLE = (24e-3, 16e-3)
R_M = np.hypot(X_M - MIDDLE[0], Y_M - MIDDLE[1])
CORNER = X_M / 48e-3 + Y_M / 32e-3 < 0.45
HILLS = [
    (6e-3 + 9e-3 * j, 6e-3 + 10e-3 * i, 20.0, -1e-8 * ((3 * i + 2 * j) % 5))
    for i in range(3)
    for j in range(5)
]


def without(lost, hills=HILLS):
    surface = caps_map(hills, SHAPE, (PIXEL_M, PIXEL_M), floor_m=-8e-7)
    return replace(surface, height_m=np.where(lost, np.nan, surface.height_m))


def analysed(surface, *words):
    given = ("contact.preload_N=200", "contact.time_limit_s=60", *words)
    return analyze_once(surface, load_settings(overrides=given))


def said_of(analysis):
    return [one for one in analysis.problems if one.code == "outline_assumed"]


def moved_energy(before, after):
    """Return the greatest change of the energy at shares of the force at gross slip."""
    one_J, other_J = (
        one.slip.energy_at_force_J(np.array((0.1, 0.25, 0.5, 0.75)) * one.slip.total_slip_force_N)
        for one in (before, after)
    )
    return float(np.abs(other_J / one_J - 1.0).max())


@pytest.mark.parametrize(
    ("lost", "as_made"),
    [
        (R_M > 15e-3, True),
        ((R_M > 15e-3) | (R_M < 4e-3), True),
        (np.abs(X_M - MIDDLE[0]) * 0.6 + np.abs(Y_M - MIDDLE[1]) > 15e-3, True),
        (np.abs(Y_M - 0.3 * X_M - 9e-3) > 8e-3, True),  # a strip that lies askew
        ((R_M > 15e-3) & (MIDDLE[0] < X_M), True),  # turned over it is the same
        (CORNER, False),
        (CORNER | (np.hypot(X_M - 48e-3, Y_M) < 6e-3), False),
        ((R_M > 15e-3) | (X_M + Y_M > 52e-3), False),
    ],
)
def test_a_part_as_made_is_on_both_sides_alike_and_a_lost_corner_is_not(lost, as_made):
    lost = lost & np.ones(SHAPE, dtype=bool)
    assert outside_as_made(without(lost)) == as_made
    wider = np.pad(lost, ((9, 4), (0, 31)), constant_values=True)  # lines without any point
    height_m = np.where(wider, np.nan, 0.0)
    assert outside_as_made(HeightMap(height_m, (PIXEL_M, PIXEL_M))) == as_made


def test_a_face_that_goes_on_sinks_as_the_rectangle():
    hole = np.hypot(X_M - 30e-3, Y_M - 20e-3) < 2e-3
    whole = filled_outside(without(CORNER))
    rectangle = bulk_compliance_m_per_N((32e-3, 48e-3), 1e11)
    assert bulk_of_face_m_per_N(whole, 1e11) == pytest.approx(rectangle, rel=1e-12)
    assert np.array_equal(np.isnan(filled_outside(without(CORNER | hole)).height_m), hole)


@pytest.mark.parametrize("lost", [CORNER, False])
def test_a_face_that_turns_keeps_its_bulk_which_is_found_once(monkeypatch, lost):
    """A law asks for it at the level of each pressure."""
    found, energies = [], bulk.energies_of_map
    monkeypatch.setattr(bulk, "energies_of_map", lambda *a: found.append(1) or energies(*a))
    bulk._of_blocks.cache_clear()
    flat = without(lost)
    turned = replace(flat, height_m=flat.height_m + 1e-5 * X_M)
    assert bulk_of_face_m_per_N(turned, 1e11) == bulk_of_face_m_per_N(flat, 1e11)
    assert len(found) == 1
    wider = replace(flat, pixel_size_m=(2 * PIXEL_M, 2 * PIXEL_M))
    half = 0.5 * bulk_of_face_m_per_N(flat, 1e11)
    assert bulk_of_face_m_per_N(wider, 1e11) == pytest.approx(half, rel=1e-12)
    assert len(found) == 2


def test_a_lost_corner_of_a_face_warns_and_tells_what_its_hills_move():
    """The corner held two hills of fifteen: what they carry is of the size that is said."""
    whole, cut = analysed(without(False)), analysed(without(CORNER))
    (problem,) = said_of(cut)
    off = moved_energy(cut, whole)
    assert problem.severity == "warning"
    assert off > 0.1
    assert off / 2.0 < problem.effect.energy < 2.0 * off
    share = bulk_of_face_m_per_N(without(CORNER), 1.0) / bulk_of_face_m_per_N(without(False), 1.0)
    assert f"{CORNER.mean():.1%} of the map" in problem.message
    assert f"sinks it {share - 1.0:.2%} deeper" in problem.message
    assert not said_of(whole)


@pytest.mark.long
def test_a_disc_is_a_note_and_what_holds_no_hill_is_none():
    (problem,) = said_of(analysed(without(R_M > 15e-3)))
    assert problem.severity == "info"
    assert not said_of(analysed(without(X_M + Y_M < 2e-3)))


def framed(surface, wide=((90, 40), (30, 100))):
    return replace(surface, height_m=np.pad(surface.height_m, wide, constant_values=np.nan))


def test_a_frame_without_a_point_does_not_change_what_is_said_of_a_lost_corner():
    cut, wider = analysed(without(CORNER)), analysed(framed(without(CORNER)))
    (problem,), (again,) = said_of(cut), said_of(wider)
    assert again.severity == problem.severity == "warning"
    assert again.message.replace("map within its lines without any point", "map") == problem.message
    assert again.effect.energy == pytest.approx(problem.effect.energy, rel=1e-3)
    assert moved_energy(cut, wider) < 1e-3


@pytest.mark.long
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_frame_alone_is_a_note_whether_points_within_stand_alone_or_not(share):
    """Points that are lost at random at an edge hang together through the frame."""
    lost = np.random.default_rng(21020).random(SHAPE) < share
    bare, wider = analysed(without(lost)), analysed(framed(without(lost)))
    assert not said_of(bare)
    (problem,) = said_of(wider)
    assert problem.severity == "info"
    assert "in lines without any point" in problem.message
    assert moved_energy(bare, wider) < 1e-3
