"""Touch, stick and slip of single contacts, against closed forms and the slip curve."""

from dataclasses import replace

import numpy as np
import output_cases
import pytest

from capslip.analysis import analyze_once
from capslip.output.arrays import _loads_N
from capslip.output.figures_surface import cap_profile
from capslip.output.report import MAX_ROWS, _cap_rows
from capslip.output.view import cap_lines, colouring, read_view
from capslip.output.zones import (
    Zones,
    compression_at,
    hill_loads_N,
    loss_shares,
    pixels_at,
    zone_at,
    zones_of,
)
from capslip.settings import load_settings
from capslip.surface.heightmap import HeightMap
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
        *(np.zeros(0, int), np.zeros(0, int), np.zeros(0), np.zeros(0)),
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


def test_contact_that_the_curve_gives_to_its_neighbour_has_no_zone(caps):
    analysis = output_cases.several()
    kept = analysis.contact.normal
    load_N = _loads_N(analysis.contact)
    approach_m = kept.approach_m(load_N)
    row_N = kept.asperity_loads_N(approach_m)
    row_N[:, np.cumsum(analysis.contact.use)[caps.cap[0]] - 1] = 0.0

    class Other:
        def asperity_loads_N(self, approach_m):
            return row_N

    other = replace(analysis, contact=replace(analysis.contact, normal=Other()))
    zones = zones_of(other, load_N, approach_m)
    np.testing.assert_array_equal(zones.cap, caps.cap[1:])
    np.testing.assert_array_equal(zones.share, caps.share[:, 1:])
    assert loss_shares(zones, 0.5).sum() == pytest.approx(1.0)


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
    middle = replace(zones, pixel_reach=0.0 * zones.pixel_reach)
    assert not pixels_at(middle, zone_at(middle, 0.0, 0.0))[0].any()
    touch, stick = pixels_at(middle, zone_at(middle, 0.1, 1.0))
    assert touch.all()
    assert not stick.any()


@pytest.fixture(scope="module")
def wavy():
    """Waves whose contacts run together under the preload."""
    rng = np.random.default_rng(7)
    per_pixel = np.hypot(np.fft.fftfreq(160)[:, None], np.fft.rfftfreq(160))
    spectrum = np.fft.rfft2(rng.normal(size=(160, 160))) * np.maximum(per_pixel, 0.03) ** -3.0
    height_m = np.fft.irfft2(spectrum, (160, 160))
    surface = HeightMap(3e-7 * height_m / height_m.std(), (5e-5, 5e-5))
    overrides = ("contact.model=boundary_elements", "contact.preload_N=600")
    lies = ("contact.alignment=as_levelled", "run.sensitivity=false")
    return analyze_once(surface, load_settings(overrides=(*overrides, *lies)))


@pytest.mark.long
@pytest.mark.parametrize("load_share", [0.25, 0.5, 0.75])
def test_as_much_of_a_map_touches_as_under_that_load(wavy, load_share):
    zones, preload_N = zones_for(wavy), wavy.contact.preload_N
    own = wavy.contact.normal.pressed(load_share * preload_N).pressure_Pa.ravel() > 0.0
    touch, stick = pixels_at(zones, zone_at(zones, load_share, 0.0))
    np.testing.assert_array_equal(touch, stick)
    assert touch.sum() == pytest.approx(own.sum(), rel=0.08)
    assert own[zones.pixel[touch]].sum() > 0.9 * own.sum()
    loads_N = zones.contact_load_N * compression_at(zones, load_share) ** 1.5
    assert loads_N.sum() == pytest.approx(load_share * preload_N, rel=1e-3)
    # What sticks under a force is what touches where that much of mu N is gone
    touch, stick = pixels_at(zones, zone_at(zones, 1.0, 1.0 - load_share))
    assert touch.all()
    np.testing.assert_array_equal(stick, pixels_at(zones, zone_at(zones, load_share, 0.0))[0])


@pytest.mark.long
def test_a_region_is_of_the_hill_under_its_greatest_pressure(wavy):
    zones, hill = zones_for(wavy), wavy.hills.label.ravel()
    pressure_Pa = wavy.contact.normal.pressed(600.0).pressure_Pa.ravel()[zones.pixel]
    for k in range(len(zones)):
        of = zones.pixel_contact == k
        top = zones.pixel[of][np.argmax(pressure_Pa[of])]
        assert zones.cap[k] == hill[top] - 1
    assert len(set(zones.cap)) > 5


@pytest.mark.long
def test_table_profile_and_picture_agree_on_what_each_hill_bears(wavy, tmp_path):
    label, n = wavy.hills.label, len(wavy.caps)
    pressed = wavy.contact.normal.pressed(600.0)
    pixel_N = pressed.pressure_Pa * np.prod(pressed.pixel_size_m)
    hill_N = np.array([pixel_N[label == i + 1].sum() for i in range(n)])
    assert 0.0 < hill_N.sum() < 600.0  # some lies beside all hills
    order = [str(i + 1) for i in np.lexsort((-wavy.caps.peak_height_m, -hill_N))]
    assert [row[0] for row in _cap_rows(wavy.caps, hill_loads_N(wavy))["rows"]] == order[:MAX_ROWS]
    title = cap_profile(wavy).axes[0].get_title(loc="left")
    usable = np.where(wavy.caps.usable, hill_N, -1.0)
    assert title.startswith(f"Cap {np.argmax(usable) + 1}, the most loaded hill")
    view = read_view(output_cases.written(wavy, tmp_path))
    np.testing.assert_allclose(view.cap_load_N, hill_N[view.cap], rtol=1e-12)
    assert colouring(view, "load").title.startswith("load on the hill [")
    own = np.isin(view.cap, view.zones.cap)
    beside = int(np.flatnonzero(~own & (view.cap_load_N > 0.0))[0])  # its neighbour's contact
    assert "no contact of its own" in cap_lines(view, beside, 1.0, 0.0)
    assert not any("touches nowhere" in one for one in cap_lines(view, beside, 1.0, 0.0))


def test_region_that_leaves_at_once_touches_under_the_whole_load_alone(pressed_map, monkeypatch):
    curve = pressed_map.contact.normal
    unloading = curve.unloading(4.0)
    share = unloading.letting_go.region_share.copy()
    share[:-1, 0] = 0.0
    left = replace(unloading.letting_go, region_share=share)
    lift_m = unloading.region_lift_off_m * [0.0, 1.0]
    at_once = replace(unloading, letting_go=left, region_lift_off_m=lift_m)
    monkeypatch.setitem(curve.solutions.unloading, 4.0, at_once)
    zones = zones_for(pressed_map)
    assert (zones.share[-1] == 1.0).all()
    assert sorted((zones.share[1:-1] > 0.0).all(axis=0)) == [False, True]
    assert sorted((zones.share[1:-1] == 0.0).all(axis=0)) == [False, True]
    assert pixels_at(zones, zone_at(zones, 1.0, 0.0))[0].all()
    assert np.isfinite(loss_shares(zones, 0.3)).all()


def test_face_that_is_not_pressed_has_no_zones(none):
    assert zones_of(none, np.zeros(1), np.zeros(1)) is None
