"""What families leave out: neighbours, and a face that turns, at places that nobody gave."""

import math

import numpy as np
import pytest

import capslip
from capslip.analysis import analyze_families
from capslip.contact.families_accuracy import MOST_CAPS, _places_m, error_of_families
from capslip.contact.given import given_families
from capslip.contact.models.families import curve_of
from capslip.contact.rung import ModelError
from capslip.settings import load_settings
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface

AREA_M2, LOAD_N = 24e-4, 300.0
E_STAR_PA = 200e9 / (2.0 * (1.0 - 0.3**2))  # of the default material
AS_IT_LIES = "contact.alignment=as_levelled"


def asked(*overrides, m=8, n=12, radius_m=10.0, h_m=1.5e-7, load_N=LOAD_N):
    families = {"m": m, "n": n, "radius_G_m": radius_m, "radius_P_m": radius_m, "h_m": h_m}
    given = (f"families.{name}={value!r}" for name, value in families.items())
    return load_settings(overrides=(*given, f"contact.preload_N={load_N!r}", *overrides))


def error(settings, area_m2=AREA_M2):
    curve = curve_of(given_families(settings), E_STAR_PA)
    return error_of_families(curve, area_m2, settings.contact.preload_N, settings)


def all_of(found: ModelError) -> list[float]:
    return [found.stiffness, *(one for _, one in found.energy_by_share)]


@pytest.mark.parametrize("seed", [911, 912, 913])
def test_the_error_holds_what_interacting_caps_of_a_scan_of_such_a_face_answer(seed):
    families = (CapFamily("G", 8, 10.0), CapFamily("P", 12, 10.0, 1.5e-7))
    surface, _ = synthetic_surface(Scene((200, 300), (2e-4, 2e-4), seed=seed, families=families))
    model = ("contact.model=interacting", f"contact.preload_N={LOAD_N!r}")
    scanned = capslip.analyze(surface, load_settings(overrides=model)).slip
    given = analyze_families(asked(f"joint.area_m2={AREA_M2!r}"))
    stated = given.contact.errors
    off = math.log(scanned.tangential_stiffness_N_per_m / given.slip.tangential_stiffness_N_per_m)
    assert abs(off) <= stated.stiffness
    for share in (0.1, 0.25, 0.5):
        force_N = share * given.slip.total_slip_force_N
        both_J = (float(one.energy_at_force_J(force_N)) for one in (scanned, given.slip))
        scanned_J, given_J = both_J
        assert abs(math.log(scanned_J / given_J)) <= stated.energy_at(share)


def test_caps_that_stand_far_apart_and_do_not_turn_leave_nothing():
    far = error(asked(AS_IT_LIES), area_m2=1e6)
    assert max(all_of(far)) < 2e-3
    near = error(asked(AS_IT_LIES))
    assert near.stiffness > 0.05
    assert error(asked()).energy > near.energy  # that of a face which turns


def test_the_error_knows_no_scale():
    """Lengths ten times as great under a hundred times the load: the same pressures."""
    one = error(asked())
    ten = error(asked(radius_m=100.0, h_m=1.5e-6, load_N=100 * LOAD_N), 100 * AREA_M2)
    assert all_of(ten) == pytest.approx(all_of(one), rel=1e-6)


def test_at_small_forces_it_stays_as_all_energies_go_with_the_cube():
    found = error(asked())
    assert found.energy_at(1e-9) == pytest.approx(found.energy_at(1e-3))


@pytest.mark.long
def test_a_part_of_many_caps_stands_for_all_and_scatters_less():
    few = asked(AS_IT_LIES, m=MOST_CAPS, n=0)
    many = asked(AS_IT_LIES, m=16 * MOST_CAPS, n=0, load_N=16 * LOAD_N)
    one, all_16 = error(few), error(many, 16 * AREA_M2)
    # The mean is that of the part, the scatter a quarter: of the stiffness it is the lesser share
    assert 0.8 * one.stiffness < all_16.stiffness < one.stiffness
    assert all_16.energy < one.energy


def test_the_energy_counts_from_a_tenth_of_mu_N_on_and_is_no_less_than_at_greater_forces():
    found = error(asked(AS_IT_LIES, m=4, n=20, h_m=3e-7))
    known = [one for _, one in sorted(found.energy_by_share)]
    assert known == sorted(known, reverse=True)
    assert found.energy == found.energy_at(0.1)
    assert known[0] > found.energy > 1.1 * known[-1]


@pytest.mark.parametrize("count", [2, 23, 100])
def test_caps_are_put_all_over_the_square_and_none_upon_another(count):
    rng = np.random.default_rng(3)
    place_m = np.array([_places_m(rng, count, 0.03) for _ in range(40)])
    assert np.abs(place_m).max() <= 0.015
    # Of a uniform distribution on the side: 0 and a twelfth of its square
    assert place_m.mean(axis=(0, 1)) == pytest.approx(0.0, abs=2e-3)
    assert place_m.std(axis=(0, 1)) == pytest.approx(0.03 / math.sqrt(12.0), rel=0.1)
    apart_m = np.linalg.norm(place_m[:, :, None] - place_m[:, None], axis=-1)
    nearest_m = np.where(apart_m > 0.0, apart_m, np.inf).min(axis=(1, 2))
    assert (nearest_m >= 0.5 * 0.03 / math.sqrt(count)).all()
    assert nearest_m.min() < 0.03 / math.sqrt(count)


def test_it_is_not_known_of_caps_that_tip_over():
    two = asked(m=2, n=0)
    assert error(two) is None
    assert error(asked(AS_IT_LIES, m=2, n=0)) is not None


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ((), []),
        (("joint.area_m2=24e-4",), ["model_doubtful"]),
        (("joint.area_m2=1e6", AS_IT_LIES), []),
    ],
)
def test_families_on_an_area_say_what_they_leave_out(overrides, said):
    found = analyze_families(asked(*overrides))
    doubtful = [one for one in found.problems if one.code == "model_doubtful"]
    assert [one.code for one in doubtful] == said
    assert (found.contact.errors is None) == (not overrides)
    assert (found.band is None) == (not overrides)
    for one in doubtful:
        assert "apart and turn the face, move" in one.message
        stated = found.contact.errors
        most = max(stated.energy_at(share) for share in (0.25, 0.5, 0.75))
        assert one.effect.tangential_stiffness == pytest.approx(math.expm1(stated.stiffness))
        assert one.effect.energy == pytest.approx(math.expm1(most))
        assert "scan of the face" in one.remedy


def test_what_is_within_the_tolerance_is_no_problem():
    stated = error(asked(AS_IT_LIES))
    most = max(stated.stiffness, *(stated.energy_at(share) for share in (0.25, 0.5, 0.75)))
    assert 0.05 < most < 0.9
    for factor, said in ((0.999, True), (1.001, False)):
        within = f"joint.area_m2={AREA_M2!r}", f"contact.tolerance={factor * most!r}"
        found = analyze_families(asked(AS_IT_LIES, *within))
        assert ("model_doubtful" in {one.code for one in found.problems}) == said


def test_the_model_of_the_settings_changes_no_error():
    given = asked("contact.model=families")
    assert np.array_equal(all_of(error(given)), all_of(error(asked())))
