"""Touch, stick and slip of single contacts, against closed forms and the slip curve."""

import numpy as np
import output_cases
import pytest

from capslip.analysis import analyze_once
from capslip.output.arrays import _loads_N
from capslip.output.zones import Zones, compression_at, loss_shares, zone_at, zones_of
from capslip.settings import load_settings
from scenes import caps_map


def zones_for(analysis):
    load_N = _loads_N(analysis.contact)
    return zones_of(analysis, load_N, analysis.contact.normal.approach_m(load_N))


@pytest.fixture(scope="module")
def caps():
    return zones_for(output_cases.several())


@pytest.fixture(scope="module")
def pressed_map():
    """Two spheres of one height on a fine map, pressed by boundary elements."""
    surface = caps_map(
        [(3e-3, 3e-3, 2.0, 0.0), (9e-3, 3e-3, 2.0, 0.0)],
        shape=(120, 240),
        pixel_size_m=(5e-5, 5e-5),
    )
    settings = load_settings(
        overrides=(
            *("contact.model=boundary_elements", "contact.preload_N=4", "conditioning.form=none"),
            "contact.alignment=as_levelled",
        )
    )
    return analyze_once(surface, settings)


def test_single_hertz_contact_sticks_inside_the_radius_of_what_is_left():
    load_N = np.linspace(0.0, 10.0, 33)
    one = np.ones(1)
    single = Zones(
        *(load_N, 1.0 - (load_N / 10.0) ** (2 / 3), (load_N / 10.0)[:, None]),
        *(10.0 * one, one, np.zeros(1, int), one),
        *(np.zeros(0, int), np.zeros(0, int), np.zeros(0)),
    )
    for load, force in ((1.0, 0.3), (0.4, 0.9), (0.013, 0.5)):
        zone = zone_at(single, load, force)
        assert zone.contact[0] == pytest.approx(load ** (1 / 3), rel=1e-9)
        assert zone.stick[0] == pytest.approx((load * (1 - force)) ** (1 / 3), rel=1e-9)
        assert zone.word[0] == "slips in part"
    assert zone_at(single, 1.0, 0.0).word[0] == "sticks"
    assert zone_at(single, 1.0, 1.0).word[0] == "slips"
    assert zone_at(single, 0.0, 0.0).word[0] == "apart"


def test_caps_touch_and_slip_where_their_own_curve_says(caps):
    analysis = output_cases.several()
    slip = analysis.slip
    curve = analysis.contact.normal
    for force_share in (0.1, 0.37, 0.8, 0.99):
        delta_m = slip.displacement_m(force_share * slip.total_slip_force_N)
        lifted = slip.limits_m <= delta_m
        slips = zone_at(caps, 1.0, force_share).word == "slips"
        assert set(caps.cap[slips]) == set(np.flatnonzero(lifted))
    for load_share in (0.05, 0.3, 0.7):
        one_N = curve.asperity_loads_N(curve.approach_m(load_share * 150.0))
        touches = zone_at(caps, load_share, 0.0).word != "apart"
        assert set(caps.cap[touches]) == set(np.flatnonzero(one_N > 0.0))
        loads_N = caps.contact_load_N * compression_at(caps, load_share) ** 1.5
        assert loads_N.sum() == pytest.approx(load_share * 150.0, rel=2e-3)


def test_more_load_touches_more_and_more_force_sticks_less(caps):
    sticks = [zone_at(caps, 1.0, force).stick for force in np.linspace(0.0, 1.0, 40)]
    assert (np.diff(sticks, axis=0) <= 1e-12).all()
    touches = [zone_at(caps, load, 0.0).contact for load in np.linspace(0.0, 1.0, 40)]
    assert (np.diff(touches, axis=0) >= -1e-12).all()
    np.testing.assert_allclose(touches[-1], 1.0)


@pytest.mark.parametrize("force_share", [0.05, 0.25, 0.6, 0.95])
def test_shares_of_the_loss_are_those_of_the_slip_curve(caps, force_share):
    """Caps that stand alone: what all but one lose is lost by the curve of all but one."""
    from capslip.contact.solvers.hertz import loss_of_asperity

    analysis = output_cases.several()
    curve, d = analysis.contact.normal, analysis.contact.approach_m
    e = curve.withdrawal_m(d, force_share * 150.0)
    loss = loss_of_asperity(curve.coefficient, np.maximum(d - curve.depth_m, 0.0), np.asarray(e))
    expected = (loss / loss.sum())[caps.cap]
    np.testing.assert_allclose(loss_shares(caps, force_share), expected, rtol=0.02, atol=2e-4)


def test_map_of_two_spheres_is_two_round_contacts_with_round_zones(pressed_map):
    zones = zones_for(pressed_map)
    assert len(zones) == 2
    assert zones.of_map
    assert set(zones.cap) == {0, 1}
    np.testing.assert_allclose(zones.contact_load_N, 2.0, rtol=1e-3)
    x_m = (zones.pixel % 240 + 0.5) * 5e-5
    y_m = (zones.pixel // 240 + 0.5) * 5e-5
    r_m = np.minimum(np.hypot(x_m - 3e-3, y_m - 3e-3), np.hypot(x_m - 9e-3, y_m - 3e-3))
    E = pressed_map.contact.composite.E_star_Pa
    a_m = (0.75 * 2.0 * 2.0 / E) ** (1 / 3)
    np.testing.assert_allclose(zones.pixel_reach * a_m, r_m, atol=5e-5)  # a pixel
    state = zone_at(zones, 1.0, 0.5)
    np.testing.assert_allclose(state.stick, 0.5 ** (1 / 3), rtol=0.02)
    assert (zone_at(zones, 1.0, 1.0).word == "slips").all()


def test_region_that_leaves_at_once_touches_under_the_whole_load_alone(pressed_map, monkeypatch):
    curve = type(pressed_map.contact.normal)
    lift_m = pressed_map.contact.normal.lift_off_m(pressed_map.contact.approach_m)
    monkeypatch.setattr(curve, "lift_off_m", lambda *_: lift_m * [0.0, 1.0])
    share = zones_for(pressed_map).share
    assert (share[-1] == 1.0).all()
    assert sorted((share[1:-1] > 0.0).all(axis=0)) == [False, True]
    assert sorted((share[1:-1] == 0.0).all(axis=0)) == [False, True]


def test_face_that_is_not_pressed_has_no_zones(none):
    assert zones_of(none, np.zeros(1), np.zeros(1)) is None
