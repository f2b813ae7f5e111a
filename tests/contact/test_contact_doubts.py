"""Doubts about the contact, from the state under the preload and the loads of the caps."""

import re
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.caps.families import group_families
from capslip.caps.table import CapFlag, CapTable
from capslip.contact import doubts
from capslip.contact.doubts import (
    contact_doubts,
    material_doubts,
    problems_of_band,
    problems_of_first_touch,
    problems_of_floor,
    problems_of_share,
    problems_of_waves,
)
from capslip.contact.part_of_joint import left_open
from capslip.contact.rung import ModelError
from capslip.doubts import _of_small_slip
from capslip.problems import Problem
from capslip.settings import Conditioning, Material
from capslip.surface.heightmap import HeightMap


def loaded_caps(load_N, contact_radius_m):
    """Caps on hills of a radius of 0.5, at random places."""
    n = len(load_N)
    every = {field.name: np.ones(n) for field in fields(CapTable)}
    places = np.random.default_rng(0).uniform(size=(3, n))
    every |= dict(zip(("x_m", "y_m", "peak_height_m"), places, strict=True))
    every |= {"peak_height_se_m": np.full(n, np.nan), "radius_m": np.full(n, 100.0)}
    every |= {"family": np.full(n, "", dtype="<U1"), "flags": np.zeros(n, np.uint16)}
    every |= {"load_N": load_N, "contact_radius_m": contact_radius_m}
    return group_families(CapTable(**every))


def severities(problems):
    return {problem.code: problem.severity for problem in problems}


def state(contacts=10, pairs=0, max_pressure_Pa=None, hardness_Pa=None, yielded_area_m2=None):
    steel = SimpleNamespace(E_star_Pa=110e9)
    return SimpleNamespace(
        contacts=contacts,
        overlapping_pairs=pairs,
        max_pressure_Pa=max_pressure_Pa,
        contact_area_m2=1e-4,
        hardness_Pa=hardness_Pa,
        yielded_area_m2=yielded_area_m2,
        yielded_share=(yielded_area_m2 or 0.0) / 1e-4,
        composite=steel,
    )


def touching(first, solved=None, yielded_area_m2=None):
    """Return a state whose approach is 1 at 10 N; a share of it is passed before any load."""

    def approach_m(load_N):
        return first + (1.0 - first) * (load_N / 10.0) ** (2 / 3)

    return SimpleNamespace(
        preload_N=10.0,
        approach_m=1.5,
        bulk_m=0.5,
        normal=SimpleNamespace(approach_m=lambda load_N: approach_m(load_N) + 0.05 * load_N),
        yielded_area_m2=yielded_area_m2,
        rung=SimpleNamespace(
            made_from="spheres" if solved is None else "map",
            solved_loads_N=None if solved is None else lambda curve, most_N: np.array(solved),
        ),
    )


def test_load_where_the_sensor_ended_is_said_from_half_a_per_cent_on():
    height_m = 1e-9 * np.random.default_rng(0).standard_normal((30, 40))
    height_m[:10] = -1e-8

    def pressed(share, shape=(30, 40), made_from="map"):
        pressure_Pa = np.zeros(shape)
        pressure_Pa[0], pressure_Pa[-1] = share, 1.0 - share
        curve = SimpleNamespace(pressed=lambda load_N: SimpleNamespace(pressure_Pa=pressure_Pa))
        rung = SimpleNamespace(made_from=made_from)
        return SimpleNamespace(rung=rung, normal=curve, preload_N=10.0)

    scan = HeightMap(height_m, (1e-6, 1e-6))
    (found,) = problems_of_floor(pressed(0.006), scan)
    assert found.message.startswith("400 points")
    assert "0.6 % of the preload" in found.message
    others = pressed(0.004), pressed(0.5, (30, 80)), pressed(0.5, made_from="spheres")
    assert [problems_of_floor(one, scan) for one in others] == [[], [], []]
    caps, whole = others[2], HeightMap(height_m[10:], (1e-6, 1e-6))
    (found,) = problems_of_floor(caps, whole, scan)  # which of its points touch nobody knows
    assert "up to 33 % of the preload" in found.message
    assert problems_of_floor(caps, scan, whole) == [found]
    assert len(problems_of_floor(caps, scan, scan)) == 2
    assert problems_of_floor(caps, whole, whole) == []


@pytest.mark.parametrize("solved", [None, [0.0, 0.01, 0.05, 0.2, 1.0, 10.0]])
def test_an_approach_that_is_passed_before_anything_carries_is_noted(solved):
    assert problems_of_first_touch(touching(0.0, solved)) == []  # Hertz: 0.01^(2/3) = 0.046
    assert problems_of_first_touch(touching(0.2, solved)) == []
    (found,) = problems_of_first_touch(touching(0.25, solved))
    assert (found.code, found.severity) == ("first_touch_decides", "info")
    assert re.match("2[89]% of the approach of 1.5 m", found.message)
    assert problems_of_first_touch(touching(0.25, solved, yielded_area_m2=1.0)) == []
    assert problems_of_first_touch(touching(0.25, [0.0, 1.0, 10.0])) == []  # not known that low


@pytest.mark.parametrize(("share", "severity"), [(0.04, "info"), (0.06, "warning")])
def test_wide_contacts_matter_by_the_load_that_they_carry(share, severity):
    load_N = np.full(10, (1.0 - share) / 9.0)
    load_N[0] = share
    caps = loaded_caps(load_N, np.where(np.arange(10) == 0, 0.6, 0.4))
    found = contact_doubts(state(), *caps, 1e-4, cut_certified=False)
    assert severities(found) == {"contact_beyond_cap": severity}


def test_contacts_that_run_together_and_lean_on_few_pixels_are_doubted():
    caps = loaded_caps(np.ones(10), np.full(10, 0.4))
    assert contact_doubts(state(), *caps, 1e-4, cut_certified=False) == []
    codes = [p.code for p in contact_doubts(state(pairs=2), *caps, 0.3, cut_certified=False)]
    assert codes == ["contacts_merge", "contact_under_resolved"]


def test_unlike_materials_and_odd_friction_are_doubted():
    assert material_doubts(Material()) == []
    unlike = {"youngs_modulus_Pa": (200e9, 3e9), "poisson_ratio": (0.3, 0.4)}
    for friction, code in ((0.2, "materials_coupled"), (2.0, "friction_suspect")):
        odd = Material(**unlike, friction_coefficient=friction)
        assert [p.code for p in material_doubts(odd)] == [code]


def caps_of(load_N, contact_radius_m, **columns):
    """One family of caps far higher and wider than their contacts, but for what is given."""
    n = len(load_N)
    caps, families = loaded_caps(np.array(load_N, dtype=float), np.array(contact_radius_m))
    wide = {"diameter_m": np.full(n, 100.0), "cap_height_m": np.full(n, 10.0)}
    given = {name: np.array(column) for name, column in columns.items()}
    return caps.with_columns(family=np.full(n, "G"), **(wide | given)), families


NAN = float("nan")
FLAGGED = {"flags": np.array([1, 0], np.uint16)}
LIGHTER = [3.0, 1.0, 1.0, 1.0], [4.0, 1.0, 1.5, 2.0]  # the lighter half ends with the last
WIDE = {"diameter_m": [2.0, 100.0]}
DEEP = {"radius_m": [2.0, 1e6], "cap_height_m": [0.0625, 0.0625]}  # 0.5^2 / (2 * 2)


@pytest.mark.parametrize(
    ("code", "severity", "load_N", "contact_radius_m", "columns", "more"),
    [
        # contacts as wide as the hill, and a twentieth of the load on those that are wider
        (None, "", [10.0, 10.0], [1.0, 9.0], WIDE, {}),
        ("contact_beyond_cap", "warning", [10.0, 10.0], [1.01, 9.0], WIDE, {}),
        ("contact_beyond_cap", "info", [1.0, 19.0], [1.01, 9.0], WIDE, {}),
        ("contact_beyond_cap", "warning", [1.01, 18.99], [1.01, 9.0], WIDE, {}),
        (None, "", [0.0, 20.0], [1.01, 9.0], WIDE, {}),
        # contacts as deep as their hill, a twentieth of the load on those that are deeper
        (None, "", [10.0, 10.0], [0.5, 0.5], DEEP, {}),
        ("contact_reaches_below_cut", "warning", [10.0, 10.0], [0.51, 0.5], DEEP, {}),
        (None, "", [1.0, 19.0], [0.51, 0.5], DEEP, {}),
        ("contact_reaches_below_cut", "warning", [1.01, 18.99], [0.51, 0.5], DEEP, {}),
        # one that touches and is not a tenth as high as the highest
        (None, "", [5.0, 5.0], [0.1, 0.1], {"cap_height_m": [1.0, 10.0]}, {}),
        ("contact_reaches_below_cut", "warning", [5.0, 5.0], [0.1, 0.1],
         {"cap_height_m": [0.99, 10.0]}, {}),
        (None, "", [0.0, 5.0], [0.1, 0.1], {"cap_height_m": [0.99, 10.0]}, {}),
        # contacts of four pixels carry the lighter half of the load
        (None, "", *LIGHTER, {}, {"pixel_area_m2": 1.0}),
        ("contact_under_resolved", "warning", *LIGHTER, {}, {"pixel_area_m2": 1.001}),
        (None, "", [0.0, 0.0], [0.0, 0.0], {}, {}),
        # a fifth of the load on flagged caps; nothing is known where caps are no contacts
        (None, "", [1.0, 4.0], [0.1, 0.1], FLAGGED, {}),
        ("load_on_doubtful_caps", "warning", [1.01, 4.0], [0.1, 0.1], FLAGGED, {}),
        (None, "", [NAN, NAN], [NAN, NAN], FLAGGED, {}),
        ("one_contact", "warning", [0.5, 0.0], [0.1, 0.0], {}, {"contacts": 1}),
        (None, "", [0.5, 0.5], [0.1, 0.1], {}, {"contacts": 2}),
        (None, "", [NAN, NAN], [NAN, NAN], {}, {"contacts": 1}),
    ],
)  # fmt: skip
def test_a_doubt_about_contact_is_raised_just_beyond_its_threshold(
    code, severity, load_N, contact_radius_m, columns, more
):
    caps, families = caps_of(load_N, contact_radius_m, **columns)
    area_m2 = more.get("pixel_area_m2", 1e-8)
    pressed = state(contacts=more.get("contacts", 10))
    found = contact_doubts(pressed, caps, families, area_m2, cut_certified=False)
    assert severities(found) == ({} if code is None else {code: severity})


@pytest.mark.parametrize("flag", list(CapFlag))
def test_the_load_is_doubtful_on_caps_of_which_a_part_or_the_apex_is_not_known(flag):
    caps, families = caps_of([1.0, 1.0], [0.1, 0.1], flags=np.array([flag, 0], np.uint16))
    found = contact_doubts(state(), caps, families, 1e-8, cut_certified=False)
    names = {"edge", "non_measured", "apex_off_surface", "noisy_apex"}
    assert [p.code for p in found] == ["load_on_doubtful_caps"] * (flag.name in names)
    said = f"50% of the preload rests on flagged caps ({flag.name})"
    assert all(p.message == said for p in found)


def test_of_flagged_caps_those_that_carry_are_named():
    flags = np.array([CapFlag.edge | CapFlag.noisy_apex, CapFlag.non_measured, 0], np.uint16)
    caps, families = caps_of([1.0, 0.0, 1.0], [0.1, 0.0, 0.1], flags=flags)
    (found,) = contact_doubts(state(), caps, families, 1e-8, cut_certified=False)
    assert found.message.endswith("(edge, noisy_apex)")


@pytest.mark.parametrize(("load_N", "silent"), [([0.5, 0.5], True), ([0.5, 0.0], False)])
def test_a_family_that_does_not_touch_is_named(load_N, silent):
    caps, families = caps_of(load_N, [0.1, 0.1])
    caps = caps.with_columns(family=np.array(["G", "P"]))
    families = replace(families, P=families.G)
    doubts = contact_doubts(state(), caps, families, 1e-8, cut_certified=False)
    found = severities(doubts)
    assert found == ({} if silent else {"P_not_in_contact": "info"})


@pytest.mark.parametrize(
    ("pressure_Pa", "hardness_Pa", "yielded_area_m2", "found"),
    [
        (1.6 * 235e6, None, None, {}),  # of S235, the softest structural steel
        (376.1e6, None, None, {"pressure_beyond_elastic": "warning"}),
        (0.03 * 110e9, None, None, {"pressure_beyond_elastic": "warning"}),
        (3.301e9, None, None, {"pressure_beyond_elastic": "error"}),
        (5e9, 6e9, 0.0, {}),  # what is given holds
        (5e9, 5e9, 2e-5, {"yielded": "info"}),
    ],
)
def test_pressure_is_doubted_just_beyond_its_threshold(
    pressure_Pa, hardness_Pa, yielded_area_m2, found
):
    caps, families = caps_of([1.0, 1.0], [0.1, 0.1])
    pressed = state(
        max_pressure_Pa=pressure_Pa, hardness_Pa=hardness_Pa, yielded_area_m2=yielded_area_m2
    )
    doubts = contact_doubts(pressed, caps, families, 1e-8, cut_certified=False)
    assert severities(doubts) == found
    assert all("20%" in p.message for p in doubts if p.code == "yielded")
    useless = [p for p in doubts if p.severity == "error"]  # beside numbers that are there
    assert all(
        p.message.endswith("elastic face, as no metal is, and not to be used") for p in useless
    )


@pytest.mark.parametrize(
    ("E_star_Pa", "pressure_Pa", "says"),
    [
        (110.0, 4.31, "pressure 4.31 Pa is more than 3 % of the modulus E* of 110 Pa, which"),
        (110e9, 4.31e9, "pressure 4.31 GPa is more than 3 % of the modulus E* of 110 GPa, which"),
    ],
)
def test_a_pressure_that_no_metal_bears_is_told_beside_the_modulus(E_star_Pa, pressure_Pa, says):
    """Which may be what is wrong."""
    caps, families = caps_of([1.0, 1.0], [0.1, 0.1])
    pressed = state(max_pressure_Pa=pressure_Pa)
    pressed.composite.E_star_Pa = E_star_Pa
    (found,) = contact_doubts(pressed, caps, families, 1e-8, cut_certified=False)
    assert found.severity == "error"
    assert says in found.text
    assert "moduli" in found.advice


@pytest.mark.parametrize(("times", "off"), [(0.9, None), (1.5, 0.5), (4.0, 3.0)])
def test_a_pressure_moves_no_more_than_the_area_that_its_hardness_needs(times, off):
    caps, families = caps_of([1.0, 1.0], [0.1, 0.1])
    pressed = state(max_pressure_Pa=times * 2.8 * 235e6)
    (found,) = contact_doubts(pressed, caps, families, 1e-8, cut_certified=False)
    assert (found.effect and found.effect.tangential_stiffness) == pytest.approx(off)


@pytest.mark.parametrize(
    ("modulus_Pa", "friction", "codes"),
    [
        # beta = 0.2857 (E1 - E2) / (E1 + E2) at equal Poisson's ratios of 0.3
        ((200e9, 96.4e9), 0.401, []),
        ((200e9, 96.2e9), 0.399, ["materials_coupled"]),
        ((96.2e9, 200e9), 0.399, ["materials_coupled"]),
        # steel on brass: more than all of a small friction, though |beta| is a mere 0.056
        ((200e9, 135e9), 0.05, ["materials_coupled"]),
        ((200e9, 200e9), 1.5, []),
        ((200e9, 200e9), 1.51, ["friction_suspect"]),
    ],
)
def test_materials_are_doubted_just_beyond_their_thresholds(modulus_Pa, friction, codes):
    material = Material(
        youngs_modulus_Pa=modulus_Pa, poisson_ratio=(0.3, 0.3), friction_coefficient=friction
    )
    assert [p.code for p in material_doubts(material)] == codes


@pytest.mark.parametrize(("beta", "coupled"), [(0.05, False), (-0.05, False), (-0.0501, True)])
def test_materials_are_coupled_beyond_a_quarter_of_their_friction(beta, coupled, monkeypatch):
    monkeypatch.setattr(doubts, "dundurs_beta", lambda *_: beta)
    assert bool(material_doubts(Material())) == coupled


@pytest.mark.parametrize(
    ("share", "codes", "doubted"),
    [
        (0.25, (), True),
        (0.25, ("detail_decides",), False),
        (0.05, ("detail_decides",), True),
        (0.45, (), False),
    ],
)
def test_pixels_that_hardly_slip_are_no_second_doubt_where_their_detail_was_measured(
    share, codes, doubted
):
    """The pixels resolve what slips from 0.4 mu N on; detail is measured from 0.1 mu N on."""
    contact = SimpleNamespace(
        rung=SimpleNamespace(least_share=lambda curve, load_N: 0.4),
        normal=None,
        errors=None,
        preload_N=100.0,
        problems=tuple(Problem(code, "warning", "so") for code in codes),
    )
    asked = SimpleNamespace(slip_force_N=20.0 * share), SimpleNamespace(total_slip_force_N=20.0)
    found = _of_small_slip(contact, *asked, 0.05)
    assert [one.severity for one in found] == ["warning"] * doubted


@pytest.mark.parametrize(
    ("share", "severity", "doubted"),
    [
        (0.15, "info", True),  # 12 % there, by a power between the two known
        (0.15, "warning", False),
        (0.24, "info", False),
        (0.25, "info", False),
    ],
)
def test_what_is_only_noted_at_small_forces_is_a_doubt_where_the_answer_is_asked(
    share, severity, doubted
):
    contact = SimpleNamespace(
        rung=SimpleNamespace(least_share=lambda curve, load_N: 0.05),
        normal=None,
        errors=ModelError(0.01, 0.3, ((0.1, 0.3), (0.25, 0.04))),
        preload_N=100.0,
        problems=(Problem("detail_decides", severity, "so"),),
    )
    asked = SimpleNamespace(slip_force_N=20.0 * share), SimpleNamespace(total_slip_force_N=20.0)
    found = _of_small_slip(contact, *asked, 0.05)
    assert [one.severity for one in found] == ["warning"] * doubted
    left = 0.3 * (share / 0.1) ** (np.log(0.04 / 0.3) / np.log(2.5))
    assert not doubted or found[0].effect.energy == pytest.approx(np.expm1(left), rel=1e-6)


@pytest.mark.parametrize(
    ("share", "least", "error", "codes", "said", "effect"),
    [
        (0.15, 0.4, 0.3, (), "leave up to 35 %", 0.3),
        (0.05, 0.02, 0.3, (), "leave up to 82 %", 0.6),  # it grows as the force falls
        (0.05, 0.02, 0.04, (), "leave up to 8.3 %", 0.08),  # from what is none at a tenth
        (0.05, 0.4, 0.3, ("detail_decides",), "off by 82 %", 0.6),
        (0.005, 0.4, 0.15, ("detail_decides",), "off by a factor of 20", 3.0),
        (0.005, 0.02, 0.04, (), "leave up to a factor of 2.2", 0.8),
        (0.05, 0.4, 0.01, ("detail_decides",), "off by more than 5 %", None),
    ],
)
def test_below_a_tenth_of_gross_slip_more_is_left_than_there(
    share, least, error, codes, said, effect
):
    contact = SimpleNamespace(
        rung=SimpleNamespace(least_share=lambda curve, load_N: least),
        normal=None,
        errors=ModelError(0.01, error, ((0.1, error), (0.25, error))),
        preload_N=100.0,
        problems=tuple(Problem(code, "warning", "so") for code in codes),
    )
    asked = SimpleNamespace(slip_force_N=20.0 * share), SimpleNamespace(total_slip_force_N=20.0)
    (found,) = _of_small_slip(contact, *asked, 0.05)
    assert said in found.message
    assert (found.effect and found.effect.energy) == (
        effect and pytest.approx(np.expm1(effect))
    )  # a share, of errors that are logarithms
    assert found.kind.in_interval  # which takes the same error


def joint(coverage, *, load_N=(1.0,), long_waves_m=0.0):
    return SimpleNamespace(
        coverage=coverage,
        is_even=len(load_N) == 1,
        load_N=np.array(load_N, dtype=float),
        long_waves_m=long_waves_m,
    )


def pressed(contacts=24, yielded_area_m2=None, made_from="spheres", caps=1000, **heights_m):
    heights_m = {"approach_m": 1e-6, "approach_without_bulk_m": None, "bulk_m": 0.0} | heights_m
    rung = SimpleNamespace(made_from=made_from, contact_name="caps")
    use = np.ones(caps, dtype=bool)
    of_state = {"yielded_area_m2": yielded_area_m2, "rung": rung, "use": use, "light": None}
    return SimpleNamespace(contacts=contacts, **of_state, **heights_m)


@pytest.mark.parametrize(
    ("of", "contact", "codes"),
    [
        (joint(0.98), pressed(), ["few_contacts_in_scan"]),
        (joint(0.995), pressed(), []),  # all of it but for rounding
        (joint(None), pressed(), []),
        (joint(0.5), pressed(25), []),
        (joint(0.5), pressed(1, made_from="nothing"), []),
        (joint(1.009), pressed(), []),
        (joint(1.011), pressed(), ["scan_larger_than_joint"]),
        (joint(0.5, load_N=(1.0, 4.0)), pressed(25, 1e-9), []),  # each yields by itself
        (joint(1.5, load_N=(1.0, 4.0)), pressed(1, 1e-9), ["scan_larger_than_joint"]),
    ],
)  # fmt: skip
def test_a_scan_is_a_doubtful_share_of_its_joint_just_beyond_each_threshold(of, contact, codes):
    found = problems_of_share(of, contact)
    assert [one.code for one in found] == codes
    for one in found:
        if one.code == "few_contacts_in_scan":
            left = left_open(of, contact)
            assert "98 % of its joint and touches with 24 caps" in one.message
            assert f"moves the energy by some {1.3 / 24**0.5:.0%}" in one.message
            stiffness, energy = left.stiffness_by_chance, left.energy_by_chance
            assert one.effect.tangential_stiffness == pytest.approx(1.0 - np.exp(-stiffness))
            assert one.effect.energy == pytest.approx(np.exp(energy) - 1.0)
            assert one.effect.loss_factor == pytest.approx(np.exp(energy - stiffness) - 1.0)


def test_few_contacts_of_a_large_joint_say_what_its_other_hills_move():
    """More than chance does, unless all caps touch: a face in one piece is softer."""
    of = joint(1e-6)
    (rough,), (all_touch,) = (problems_of_share(of, pressed(9, caps=caps)) for caps in (1000, 9))
    by_choice = left_open(of, pressed(9)).by_choice
    assert rough.effect.energy == pytest.approx(np.exp(by_choice.energy) - 1.0)
    assert rough.effect.tangential_stiffness == pytest.approx(1 - np.exp(-by_choice.stiffness))
    assert "in one piece is about 37% less stiff and loses some 1.8 times as much" in rough.message
    assert "in one piece" not in all_touch.message
    assert 0.0 < all_touch.effect.energy < rough.effect.energy


@pytest.mark.parametrize(
    ("coverage", "rms_m", "approach_m", "without_bulk_m", "said"),
    [
        (0.98, 1.01e-7, 2e-6, 1e-6, True),  # over the approach without bulk
        (0.98, 1.01e-7, 1e-6, None, True),
        (0.98, 1e-7, 2e-6, 1e-6, False),
        (0.98, 1.5e-7, 2e-6, 0.0, False),  # a model that knows no other
        (0.98, 1.5e-7, 0.0, None, False),
        (0.995, 1.5e-7, 1e-6, 1e-6, False),
        (None, 1.5e-7, 1e-6, 1e-6, False),
    ],
)
def test_waves_that_a_scan_does_not_hold_are_doubted_beyond_a_tenth_of_the_approach(
    coverage, rms_m, approach_m, without_bulk_m, said
):
    contact = pressed(approach_m=approach_m, approach_without_bulk_m=without_bulk_m)
    of = joint(coverage, long_waves_m=rms_m)
    found = problems_of_waves(of, contact)
    assert [one.code for one in found] == ["waves_longer_than_scan"] * said
    for one in found:
        assert "stand 1e-07 m (rms) out of its spectrum, 10%" in one.message
        stiffness, energy = left_open(of, contact).by_waves
        assert one.effect.tangential_stiffness == pytest.approx(1.0 - np.exp(-stiffness))
        assert one.effect.energy == pytest.approx(np.exp(energy) - 1.0)
        assert one.kind.in_interval


@pytest.mark.parametrize(
    ("rms_m", "high"), [(9.9e-6, "990% of the approach: "), (9.1e-5, "91 times the approach: ")]
)
def test_waves_many_times_as_high_as_the_approach_are_no_percentage(rms_m, high):
    (found,) = problems_of_waves(joint(0.01, long_waves_m=rms_m), pressed())
    assert f"out of its spectrum, {high}" in found.message


@pytest.mark.parametrize(
    ("shortest_m", "nesting_m", "why"),
    [
        (8.1e-6, None, "shorter waves drown in its noise of 3e-09 m a point"),
        (8.1e-6, 5e-6, "shorter waves drown in its noise"),
        (8.1e-6, 8.1e-6, "shorter ones were filtered off"),
        (8e-6, None, ""),  # half of the load on contacts as wide
        (6.0e-6, None, ""),
    ],
)
def test_contacts_narrower_than_any_wave_of_the_map_are_noted(
    shortest_m, nesting_m, why, monkeypatch
):
    asked = []

    def carried(*given, enough_m):
        asked.append((*given, enough_m))
        return shortest_m, 1e-3

    monkeypatch.setattr(doubts, "carried_waves_m", carried)
    caps, _ = caps_of([1.0, 1.0], [4e-6, 4e-6])
    surface = HeightMap(np.zeros((4, 4)), (1e-6, 4e-6))
    found = problems_of_band(caps, surface, 3e-9, Conditioning(s_filter_nesting_index_m=nesting_m))
    assert asked == [(surface, 3e-9, nesting_m, pytest.approx(8e-6))]
    assert [one.code for one in found] == ["contacts_outside_band"] * bool(why)
    assert why in "".join(one.message for one in found)


def test_contacts_of_two_pixels_are_said_to_be_so_and_not_to_be_out_of_the_band(monkeypatch):
    """Of the longer side of a pixel."""
    caps, _ = caps_of([1.0, 1.0], [1e-6, 1e-6])
    for size_m, noted in ((4.05e-6, False), (3.95e-6, True)):
        surface = HeightMap(np.zeros((4, 4)), (1e-6, size_m))
        monkeypatch.setattr(doubts, "carried_waves_m", lambda *_, enough_m: (8e-6, 1e-3))
        assert bool(problems_of_band(caps, surface, 0.0, Conditioning())) == noted
    none, _ = caps_of([NAN, NAN], [NAN, NAN])
    assert problems_of_band(none, surface, 0.0, Conditioning()) == []


@pytest.mark.parametrize(
    ("share", "said"),
    [
        (1e-9, "less than 0.5 % of"),
        (4.9e-3, "less than 0.5 % of"),
        (6e-3, "1% of"),
        (0.72, "72% of"),
    ],
)
def test_what_has_yielded_is_never_said_to_be_nothing(share, said):
    contact = state(max_pressure_Pa=5e9, hardness_Pa=5e9, yielded_area_m2=share * 1e-4)
    given = caps_of([1.0, 1.0], [0.1, 0.1])
    (one,) = (one for one in contact_doubts(contact, *given, 1e-8, cut_certified=False))
    assert one.message.startswith(f"{said} the contact area has yielded")
