"""A map that has yielded, as metal unloads it: closed forms, and finite elements of tops."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from capslip.contact.as_metal import MOST, RESOLVED, as_metal
from capslip.contact.curve import in_series
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.plastic_law import SHARES, SMALL_SHARES, LawError, law_of_map
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.hertz import HertzCurve
from capslip.contact.solvers.unloading import Unloading
from capslip.errors import ContactError
from capslip.studies.plastic_sphere import mesh_of
from capslip.studies.plastic_tops import TOPS, answer_of, by_elements, by_map, stated
from capslip.surface.heightmap import HeightMap

E_PA, R_M, PRELOAD_N = 110e9, 8e-3, 2.0
ROUND = HertzCurve("caps", np.ones(1), np.array([R_M]), np.zeros(1), E_PA)
APPROACH_M = float(ROUND.approach_m(PRELOAD_N))


def hertz(drop_N):
    """Return withdrawal and loss of a Hertz contact."""
    lost = ROUND.loss_integral_at_drop_J(APPROACH_M, drop_N)
    return ROUND.withdrawal_m(APPROACH_M, drop_N), lost


def unloading(resolved=0.0):
    """Return what a map without pixels would find of it."""
    drop_N = PRELOAD_N * np.append(np.geomspace(1e-5, 0.5, 400)[:-1], np.linspace(0.5, 1.0, 400))
    x_m, loss_J = hertz(drop_N)
    return Unloading(
        load_N=PRELOAD_N,
        approach_m=APPROACH_M,
        stiffness_N_per_m=float(ROUND.stiffness_N_per_m(APPROACH_M)),
        withdrawal_m=x_m,
        load_drop_N=drop_N,
        loss_J=loss_J,
        region_lift_off_m=np.array([0.3, 1.0]) * x_m[-1],
        solved_load_N=np.array([PRELOAD_N]),
        solved_approach_m=np.array([APPROACH_M]),
        loss_error=0.0,
        smallest_drop_N=resolved * PRELOAD_N,
        unknown_to_N=resolved * PRELOAD_N,
    )


SMALL = tuple(np.log(hertz(PRELOAD_N * np.array(SMALL_SHARES))[1]).tolist())
NOTHING = LawError(0.0, (0.0,) * 4, (0.0,) * 4, (0.0,) * 4, small_slip=SMALL)


@pytest.mark.parametrize("resolved", [0.0, 0.01, 0.1, 0.4])
def test_a_law_that_moves_nothing_leaves_a_hertz_contact(resolved):
    """And what pixels would not resolve of it comes from round contacts, at whatever energy."""
    found = as_metal(unloading(resolved), replace(NOTHING, small_slip=np.add(SMALL, 7.0)), 0.0)
    drop_N = PRELOAD_N * np.geomspace(2e-3, 0.999, 50)
    x_m, loss_J = hertz(drop_N)
    log = np.log(drop_N), np.log(found.load_drop_N)
    assert np.exp(np.interp(*log, np.log(found.loss_J))) == pytest.approx(loss_J, rel=0.02)
    assert np.exp(np.interp(*log, np.log(found.withdrawal_m))) == pytest.approx(x_m, rel=2e-3)
    assert found.stiffness_N_per_m == pytest.approx(unloading().stiffness_N_per_m, rel=1e-12)
    assert found.region_lift_off_m == pytest.approx(unloading().region_lift_off_m, rel=2e-3)
    assert (np.diff(found.withdrawal_m) > 0.0).all()
    assert found.load_drop_N[-1] == PRELOAD_N


def test_what_is_found_is_one_curve():
    """L = 4 s x - 8 integral of x ds, whatever the law expects."""
    energy = (-0.9, -0.6, -0.2, 0.1)
    law = LawError(0.08, (0.0,) * 4, energy, (0.0,) * 4, small_slip=SMALL)
    found = as_metal(unloading(0.05), law, 0.0)
    s, x = found.load_drop_N, found.withdrawal_m
    way = np.append(0.5 * s[0] * x[0], 0.5 * (x[1:] + x[:-1]) * np.diff(s))
    loss_J = 4.0 * s * x - 8.0 * np.cumsum(way)
    large = s > 0.3 * PRELOAD_N  # of smaller drops it is a small difference
    assert found.loss_J[large] == pytest.approx(loss_J[large], rel=0.02)
    assert found.stiffness_N_per_m == pytest.approx(
        unloading().stiffness_N_per_m * np.exp(0.08), rel=1e-12
    )
    of_hertz_J = hertz(PRELOAD_N * np.array(SHARES))[1]
    at = np.interp(PRELOAD_N * np.array(SHARES), s, found.loss_J)
    # What is named at a stiffness is less by that at a force
    expected = np.array(energy)[1:] - 0.08
    assert np.log(at / of_hertz_J)[1:] == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("resolved", [0.02, 0.06, 0.3])
def test_below_what_pixels_resolve_the_energy_falls_as_that_of_metal(resolved):
    """Wherever the map has none: it is continued from twice that force, or a quarter of mu N."""
    from_N = min(RESOLVED * resolved, MOST) * PRELOAD_N
    blind = unloading(resolved)
    blind = replace(
        blind,
        loss_J=np.where(blind.load_drop_N < 0.9 * from_N, 1e-280, blind.loss_J),
    )
    steep = tuple((5.0 * np.log(SMALL_SHARES)).tolist())
    found = as_metal(blind, replace(NOTHING, small_slip=steep), 0.0)
    share = np.array((2e-3, 0.01, 0.03))
    share = share[share * PRELOAD_N < from_N]
    loss_J = np.exp(
        np.interp(np.log(share * PRELOAD_N), np.log(found.load_drop_N), np.log(found.loss_J))
    )
    k = np.searchsorted(blind.load_drop_N, from_N, side="right") - 1
    end_N = blind.load_drop_N[k]
    assert loss_J == pytest.approx(blind.loss_J[k] * (share * PRELOAD_N / end_N) ** 5, rel=0.02)
    # Pixels know nothing up to a force beyond that: what is unknown stays so
    assert found.unknown_to_N == (0.0 if resolved < MOST else blind.unknown_to_N)


@pytest.mark.parametrize("share", [-0.4, 0.5])
def test_a_spring_in_series_is_no_metal(share):
    """The law moves the stiffness of both, which a share of the contact has had its part in."""
    alone = unloading()
    spring = share / alone.stiffness_N_per_m
    found = as_metal(alone, replace(NOTHING, stiffness=0.05, energy=(0.05,) * 4), spring)
    whole, was = (1.0 / one.stiffness_N_per_m + spring for one in (found, alone))
    assert np.log(was / whole) == pytest.approx(0.05, rel=1e-9)


@cache
def curve_of(over_hardness, points=41):
    """Return the curve of a sphere of 10 pixels of radius of contact, and its load."""
    pixel_m, a_m = 1e-6, 10e-6
    at_m = np.square((np.arange(points) - points // 2 + 0.3) * pixel_m)
    load_N = 4.0 * E_PA * a_m**3 / (3.0 * R_M)
    hardness_Pa = 1.5 * load_N / (np.pi * a_m**2) / over_hardness
    surface = HeightMap(-(at_m[:, None] + at_m) / (2.0 * R_M), (pixel_m, pixel_m))
    return boundary_elements(surface, E_PA, preload_N=load_N, hardness_Pa=hardness_Pa), load_N


@pytest.mark.long
@pytest.mark.parametrize("over_hardness", [1.2, 3.0])
def test_answers_of_a_map_hold_what_the_law_expects(over_hardness):
    """Stiffness, withdrawal and loss at a force; as solved, none of it, nor below that load."""
    curve, load_N = curve_of(over_hardness)
    solved, law = replace(curve, as_solved=True), curve.law(load_N)
    assert law == law_of_map(solved, load_N)
    assert solved.law(load_N) is None
    assert curve.law(0.5 * load_N) is None
    d, drop_N = curve.approach_m(load_N), np.array((0.5, 0.75)) * load_N
    K, x_m, loss_J = (
        np.log(one / other)
        for one, other in zip(
            *(
                (
                    one.stiffness_N_per_m(d),
                    one.withdrawal_m(d, drop_N),
                    one.loss_integral_at_drop_J(d, drop_N),
                )
                for one in (curve, solved)
            ),
            strict=True,
        )
    )
    assert float(K) == pytest.approx(law.stiffness, abs=1e-9)
    moved, more = np.transpose([law.shift(share) for share in (0.5, 0.75)])
    assert loss_J == pytest.approx(more, abs=1e-3)
    assert x_m == pytest.approx(moved, abs=0.02)


@pytest.mark.long
def test_slip_of_metal_is_one_curve_with_the_bulk_or_without():
    curve, load_N = curve_of(3.0)
    rest = in_series(curve, -0.3 / float(curve.stiffness_N_per_m(curve.approach_m(load_N))))
    for one in (curve, rest):
        d = one.approach_m(load_N)
        drop_N = load_N * np.geomspace(0.01, 0.9, 20)
        x_m = one.withdrawal_m(d, drop_N)
        assert one.load_drop_N(d, x_m) == pytest.approx(drop_N, rel=1e-6)
        assert one.loss_integral_J(d, x_m) == pytest.approx(
            one.loss_integral_at_drop_J(d, drop_N), rel=1e-5
        )
        slip = slip_curve(one, load_N, 0.2, 1.2)
        T = 0.3 * 0.2 * load_N
        u_m, force_N = slip.loop(float(slip.displacement_m(T)), 2001)
        area_J = abs(float(np.sum(0.5 * (force_N[1:] + force_N[:-1]) * np.diff(u_m))))
        assert area_J == pytest.approx(float(slip.energy_at_force_J(T)), rel=0.02)


@pytest.mark.long
def test_other_loads_and_hardnesses_move_what_the_map_does_by_its_own_factors():
    """The law of the known load is in them once."""
    curve, load_N = curve_of(3.0)
    for changes in ([(1.0, 1.0)], [(1.0, 1.0), (0.9, 1.1)]):
        (same, *_) = curve.near(load_N, changes, 0.25)
        d = curve.approach_m(load_N)
        drop_N = np.array((0.1, 0.25, 0.6)) * load_N
        for name in ("withdrawal_m", "loss_integral_at_drop_J"):
            value = getattr(same, name)(same.approach_m(load_N), drop_N)
            assert value == pytest.approx(getattr(curve, name)(d, drop_N), rel=0.01), name


@pytest.mark.long
@pytest.mark.parametrize("pixels", [8, 14])
@pytest.mark.parametrize("overload", [1.4, 3.0])
@pytest.mark.parametrize("top", [TOPS[0], TOPS[2], TOPS[4]], ids=lambda top: top.name)
def test_maps_of_tops_that_yield_answer_as_finite_elements_do(top, overload, pixels, monkeypatch):
    """K within 5 %, W within a third from a quarter of mu N on and a factor of two at a tenth."""
    monkeypatch.setattr("capslip.studies.plastic_tops.PIXELS", pixels)
    contact = by_elements(top, overload, mesh_of(130))
    found, errors = by_map(top, contact.load, contact.yield_stress)
    true = answer_of(contact)
    of_K, of_W = np.log(true.withdrawal / found.withdrawal), np.log(found.energy / true.energy)
    assert np.abs(of_K).max() < 0.05
    assert np.abs(of_W)[1:].max() < np.log(4.0 / 3.0)
    assert abs(of_W[0]) < np.log(2.0)
    K, W = stated(errors)
    for off, (low, high) in ((of_K, K.T), (of_W, W.T)):
        assert (low < off).all()
        assert (off < high).all()
    assert (W[:, 1] < np.log(8.0)).all()  # nowhere anything


def test_a_contact_of_too_few_pixels_to_slip_says_so():
    """Whatever metal would do there: slip is refused as it is of an elastic one."""
    at_m = np.square((np.arange(9) - 4.0) * 1e-6)
    surface = HeightMap(-(at_m[:, None] + at_m) / (2.0 * R_M), (1e-6, 1e-6))
    curve = boundary_elements(surface, E_PA, preload_N=1.9e-6, hardness_Pa=2e6)
    assert curve.pressed(1.9e-6).over_hardness.max() > 0.9
    assert curve.law(1.9e-6) is None
    with pytest.raises(ContactError, match="1 pixels; expected at least 8"):
        curve.unloading(1.9e-6)
