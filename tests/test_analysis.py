"""What an analysis decides between its stages: what is refused, told once, and left open."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from capslip import analysis
from capslip.contact.joint import Joint
from capslip.errors import SettingsError
from capslip.problems import KINDS, Effect, Problem
from capslip.settings import load_settings

SPIKES = Problem("spikes", "warning", "nine")


def scan(name, *problems):
    return SimpleNamespace(name=name, problems=problems)


def test_what_all_scans_have_is_told_once_and_the_rest_with_its_scan():
    few, steps = (Problem(code, "warning", "x") for code in ("seams", "heights_in_steps"))
    other = replace(SPIKES, message="ten")
    asked = [Problem(code, KINDS[code].severities[0], "") for code in analysis.ASKED_OF_THE_JOINT]
    found = analysis._of_scans(
        [scan("a", few, SPIKES, steps, *asked), scan("b", few, other, *asked), scan("c", few)]
    )
    assert [(one.code, one.message) for one in found] == [
        ("seams", "x"), ("spikes", "a (and 1 more scan): nine"), ("heights_in_steps", "a: x")
    ]  # fmt: skip


def test_what_several_scans_have_is_told_of_the_one_where_it_moves_most():
    def seen(energy):
        return replace(SPIKES, message=f"{energy}", effect=Effect(None, energy, energy))

    twice = (seen(0.1), seen(0.7))  # a scan may have two of one kind
    note = Problem("seams", "info", "y")
    failed = Problem("contact_failed", "error", "too much")
    found = analysis._of_scans(
        [
            scan("a", *twice, note, failed),
            scan("b", seen(0.3), replace(note, severity="warning")),
            scan("c", seen(0.2), failed),
        ]
    )
    assert [(one.severity, one.message) for one in found] == [
        ("warning", "b (and 2 more scans): 0.3"), ("warning", "a: 0.7"), ("info", "a: y"),
        ("error", "a: too much"), ("warning", "b: y"), ("error", "c: too much"),
    ]  # fmt: skip


def test_slip_is_known_from_where_the_maps_of_all_parts_resolve_it():
    """Of caps from nothing on."""

    def part(share):
        least_share = None if share is None else lambda curve, load_N: share * curve * load_N
        contact = SimpleNamespace(
            rung=SimpleNamespace(least_share=least_share), normal=2.0, preload_N=3.0
        )
        return SimpleNamespace(contact=contact)

    for shares, expected in (((), 0.0), ((None,), 0.0), ((0.01, 0.02, None), 0.12)):
        found = SimpleNamespace(parts=tuple(part(share) for share in shares))
        assert analysis._resolved_from(found) == pytest.approx(expected, abs=1e-15)


def test_an_interval_leaves_out_what_another_face_would_move():
    effect = Effect(0.1, 0.1, 0.1)
    inside = next(code for code, kind in KINDS.items() if kind.in_interval and allows(kind))
    outside = [c for c, kind in KINDS.items() if not kind.in_interval and allows(kind)][:2]
    known = [Problem(code, "warning", "", effect) for code in (inside, *outside)]
    assert analysis._open(known, of_map=True) == tuple(f"what {code} moves" for code in outside)
    of_two_scans = [one for one in known for _ in range(2)]
    assert analysis._open(of_two_scans, of_map=True) == analysis._open(known, of_map=True)
    noted = [replace(one, severity="info") for one in known if "info" in one.kind.severities]
    without = [replace(one, effect=None) for one in known]
    assert analysis._open([*noted, *without], of_map=True) == ()


def test_what_filled_points_of_a_pressed_map_move_is_left_out_however_little():
    """Caps average over them, and say what that leaves; no number of a map does."""
    filled = [Problem("points_filled", "info", "x")]
    assert analysis._open(filled, of_map=True) == ("what points_filled moves",)
    assert analysis._open(filled, of_map=False) == ()


def allows(kind):
    return "warning" in kind.severities


@pytest.mark.parametrize(
    ("model", "errors", "estimates", "lacks"),
    [
        ("caps", None, None, True),  # it was forced
        ("caps", "known", "can", True),
        ("auto", None, "can", True),
        ("auto", "known", "can", False),
        ("auto", None, None, False),  # a rung whose error its choice has told
    ],
)
def test_an_error_is_estimated_that_no_choice_told(model, errors, estimates, lacks):
    contact = SimpleNamespace(errors=errors, rung=SimpleNamespace(error=estimates))
    settings = load_settings(overrides=(f"contact.model={model}",))
    assert analysis._lacks_error(contact, settings) == lacks


def test_scans_share_the_load_of_their_joint_and_its_patches():
    """Two scans of 1 and 3 mm2: of the patches of either, a quarter and three quarters are."""
    one = Joint(
        preload_N=80.0, load_N=np.array([2.0]), weight=np.array([40.0]), scan_load_N=2.0,
        area_m2=40e-6, scan_area_m2=1e-6,
    )  # fmt: skip
    other = replace(
        one, scan_area_m2=3e-6, load_N=3.0 * one.load_N, weight=one.weight / 3.0, scan_load_N=6.0
    )
    parts = [SimpleNamespace(joint=one, share=0.25), SimpleNamespace(joint=other, share=0.75)]
    joint = analysis._joint(parts)
    assert joint.scan_area_m2 == pytest.approx(4e-6)
    assert joint.load_N == pytest.approx([8.0])  # under the same pressure
    assert joint.weight == pytest.approx([10.0])
    assert joint.scan_load_N == pytest.approx(8.0)
    assert joint.load_N @ joint.weight == pytest.approx(joint.preload_N)


AREA = "joint.area_m2=0.01"


@pytest.mark.parametrize(
    ("n", "words", "said"),
    [
        (0, [AREA], "scans: got 0; expected two scans"),
        (1, [AREA], "scans: got 1; expected two scans"),
        (2, [], "joint.area_m2: got 2 scans"),
        (2, [AREA, "slip.normal_amplitude_ratio=0.1"], "normal_amplitude_ratio: got 0.1 with 2"),
        (2, [AREA, "contact.model=flat"], "contact.model: got flat with 2 scans"),
        (2, [AREA], None),
        (2, ["joint.pressure_map=p.csv"], None),
        (3, [AREA, "contact.model=caps"], None),
        (2, [AREA, "contact.model=families"], None),
    ],
)
def test_scans_of_no_joint_are_refused(n, words, said):
    settings = load_settings(overrides=words)
    if said is None:
        analysis.check_scans([None] * n, settings)
    else:
        with pytest.raises(SettingsError, match=said):
            analysis.check_scans([None] * n, settings)


TOGETHER, MAP = "mating.way=together", "contact.model=boundary_elements"


@pytest.mark.parametrize(
    ("mate", "words", "said"),
    [
        (None, ["families.m=3"], "families.m: got families together with a scan"),
        (None, ["families.h_m=1e-7"], "families.h_m: got families"),
        ("mate", [TOGETHER, MAP], "got boundary_elements with mating.way = together"),
        ("mate", [TOGETHER, "contact.model=caps"], None),
        ("mate", [TOGETHER], None),
        ("mate", [MAP], None),
        (None, [TOGETHER, MAP], None),
    ],
)
def test_two_maps_of_caps_are_no_map_to_press_and_families_no_scan(mate, words, said):
    settings = load_settings(overrides=words)
    if said is None:
        analysis._check(settings, mate)
    else:
        with pytest.raises(SettingsError, match=said):
            analysis._check(settings, mate)


def test_families_that_yield_slip_after_the_greatest_load_of_a_cycle(monkeypatch):
    loads_N = []

    def curve_after(contact, load_N, *_):
        loads_N.append(load_N)
        return contact.curve

    monkeypatch.setattr(analysis.ContactState, "curve_after", curve_after)
    monkeypatch.setattr(analysis, "_answered", lambda found, _: found)
    given = {"m": 5, "n": 18, "radius_G_m": 23.8, "radius_P_m": 26.7, "h_m": 2.4e-7}
    words = [f"families.{name}={value}" for name, value in given.items()]
    more = ("contact.preload_N=400", "slip.normal_amplitude_ratio=0.3", "material.hardness_Pa=1e9")
    found = analysis.analyze_families(load_settings(overrides=(*words, *more)))
    assert found.slip.preload_N == 400.0
    assert loads_N[0] == pytest.approx(520.0)


FLOOR, ROBUST = "form_floor=true", "form_robust=true"


@pytest.mark.parametrize(
    ("table", "idle", "harmless", "says"),
    [
        ("conditioning", (FLOOR, ROBUST), ((FLOOR,), (ROBUST,)), "form_robust and form_floor"),
        (
            "hills",
            ("separation=regions", "pruning_height_m=1e-7"),
            (("separation=regions",), ("pruning_height_m=1e-7",)),
            "pruning_height_m with separation = regions",
        ),
        (
            "hills",
            ("separation=regions", "pruning_percent_Sz=5"),
            (("separation=watershed", "pruning_percent_Sz=5"),),
            "pruning_percent_Sz with separation = regions",
        ),
        (
            "contact",
            ("alignment=as_levelled", "alignment_stiffness_Nm_per_rad=1"),
            (
                ("alignment=as_levelled", "alignment_stiffness_Nm_per_rad=0"),
                ("alignment_stiffness_Nm_per_rad=1",),
            ),
            "alignment_stiffness_Nm_per_rad with alignment = as_levelled",
        ),
    ],
)
def test_a_setting_that_would_do_nothing_beside_another_is_refused(table, idle, harmless, says):
    def of(words):
        return load_settings(overrides=tuple(f"{table}.{word}" for word in words))

    with pytest.raises(SettingsError, match=f"{table}: got {says}"):
        of(idle)
    for words in harmless:
        of(words)
