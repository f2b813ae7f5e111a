"""Given families on the command line, against the paper's table and the analysis of a scan."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import capslip
from capslip.analysis import analyze_families
from capslip.cli import main
from capslip.errors import SettingsError
from capslip.options import MODELS
from scenes import PROJECT, caps_map

PAIR = ("--m", "5", "--n", "18", "--radius-G", "23.8", "--radius-P", "26.7", "--h", "2.4e-7")


def run(*options):
    return CliRunner().invoke(main, ["families", *options])


def test_the_papers_families_give_its_loads_and_limits(tmp_path):
    ran = run(*PAIR, "--approach", "2.5e-7", "--json", "-o", str(tmp_path / "out"))
    assert ran.exit_code == 0, ran.output
    summary = json.loads(ran.stdout)
    # E 200 GPa, nu 0.3, mu 0.2: computed twice, independently
    assert summary["contact"]["preload_N"] == pytest.approx(460.4, rel=2e-4)
    slip = summary["slip"]
    assert slip["limit_G_m"] == pytest.approx(6.071e-8, rel=1e-3)
    assert slip["limit_P_m"] == pytest.approx(2.429e-9, rel=1e-3)
    assert slip["tangential_stiffness_N_per_m"] == pytest.approx(3.89e9, rel=1e-3)
    assert slip["total_slip_force_N"] == pytest.approx(92.1, rel=1e-3)
    assert (summary["families"]["m"], summary["families"]["n"]) == (5, 18)
    assert summary["surface"] is None
    assert json.loads((tmp_path / "out" / "summary.json").read_text()) == summary
    again = analyze_families(capslip.load_settings(tmp_path / "out" / "settings.toml")).summary()
    for table in ("contact", "slip", "answer", "assumed", "verdict"):
        assert again[table] == summary[table]


def test_settings_of_a_scan_are_named_and_move_nothing(tmp_path):
    """The file of a scan serves its families, too; what it wrote out runs again as it was."""
    paper = ("--config", str(PROJECT / "configs" / "peyret2016.toml"))
    told = " ".join(run(*PAIR, *paper, "-o", str(tmp_path / "out")).stdout.split())
    assert "info settings_ignored: hills.cut, hills.separation, caps.fit, families.count" in told
    plain = run(*PAIR, "--preload", "460", "-o", str(tmp_path / "plain")).stdout
    assert "settings_ignored" not in plain
    answers = [json.loads((tmp_path / f / "summary.json").read_text()) for f in ("out", "plain")]
    assert answers[0]["slip"] == answers[1]["slip"]
    again = capslip.load_settings(tmp_path / "plain" / "settings.toml")
    codes = {one.code for one in analyze_families(again).problems}
    assert "settings_ignored" not in codes


def test_what_is_to_know_is_told_where_no_report_is_written(tmp_path):
    for more in ((), ("-o", str(tmp_path / "out"))):
        told = " ".join(run(*PAIR, "--preload", "460", *more).stdout.split())
        assert "see the report" not in told
        assert "info peak_at_gross_slip: the loss factor still grows where" in told
    assert not list(tmp_path.rglob("report.html"))


@pytest.mark.parametrize(
    ("displacement", "force_N", "energy_J"),
    [("1nm", 3.694, 2.728e-10), ("5nm", 13.53, 3.488e-8), ("40nm", 74.27, 1.381e-6)],
)
def test_the_papers_families_answer_at_a_displacement(displacement, force_N, energy_J):
    ran = run(*PAIR, "--approach", "2.5e-7", "--displacement", displacement, "--json")
    answer = json.loads(ran.stdout)["answer"]
    assert answer["slip_force_N"] == pytest.approx(force_N, rel=3e-4)
    assert answer["energy_J"] == pytest.approx(energy_J, rel=3e-4)


def test_the_terminal_shows_families_as_it_shows_a_scan():
    ran = run(*PAIR, "--preload", "460", "--slip-force", "20N")
    assert ran.exit_code == 0, ran.output
    labels = [line[:10].strip() for line in ran.stdout.splitlines()]
    assert labels[:2] == ["verdict", "answer"]
    assert {"families", "contact", "slip", "damping", "status"} <= set(labels)
    assert not {"scan", "hills", "level"} & set(labels)
    assert "at slip force 20 N" in ran.stdout
    assert "with bulk" not in ran.stdout  # which needs the size of a scan
    assert "R 23.8 m\n" in ran.stdout  # no diameter of hills that are not known


def test_given_families_answer_as_those_that_were_counted():
    caps = [(5e-3, 5e-3, 20.0, 0.0), (25e-3, 6e-3, 20.0, 0.0), (15e-3, 15e-3, 24.0, -5e-8)]
    settings = ("contact.model=families", "contact.preload_N=150", "families.count=2")
    scan = capslip.analyze(caps_map(caps), capslip.load_settings(overrides=settings))
    G, P = scan.families.G, scan.families.P
    given = {"m": G.count, "radius_G_m": G.radius_m}
    given |= {"n": P.count, "radius_P_m": P.radius_m, "h_m": scan.families.h_m} if P else {}
    sets = tuple(f"families.{name}={value!r}" for name, value in given.items())
    found = analyze_families(capslip.load_settings(overrides=(*settings, *sets)))
    ours, theirs = found.summary(), scan.summary()
    assert P is not None
    for table in ("slip", "answer"):
        for key, value in theirs[table].items():
            # spheres that were fitted may be a little long; those that were given are round
            if isinstance(value, float) and key != "softest_direction_rad":
                assert ours[table][key] == pytest.approx(value, rel=1e-9), key


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "expected at least families.m and families.radius_G_m (--m, --radius-G)"),
        (("--m", "5", "--radius-G", "20", "--n", "3"), "families.n: got 3 P-caps; expected"),
        ((*PAIR, "--approach", "1e-7", "--preload", "3"), "got contact.preload_N and families.app"),
        ((*PAIR, "--set", "contact.nominal_pressure_Pa=1e6"), "expected joint.area_m2 with it"),
        (("--m", "0", "--radius-G", "20"), "families.m: got 0; expected"),
    ],
)
def test_families_in_part_are_a_usage_error_in_one_line(options, said):
    ran = run(*options)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in ran.stderr
    assert ran.stderr.count("\n") == 1


def test_one_family_is_enough():
    ran = run("--m", "5", "--radius-G", "23.8", "--preload", "89.35", "--json")
    assert ran.exit_code == 0, ran.output
    assert json.loads(ran.stdout)["families"]["P"] is None


@pytest.mark.parametrize(("share", "closes"), [(0.249, False), (0.251, True), (0.999, True)])
def test_contacts_are_held_against_the_area_of_the_joint(share, closes):
    """Five spheres in a row: each touches on pi a^2, with a^3 = 3 N R / (4 E*)."""
    E_star_Pa, R, N, m = 200e9 / (2 * (1 - 0.3**2)), 23.8, 460.0, 5
    contact_m2 = m * np.pi * (0.75 * N / m * R / E_star_Pa) ** (2 / 3)
    one = ("--m", str(m), "--radius-G", str(R), "--preload", str(N), "--json", "--area")
    ran = run(*one, f"{contact_m2 / share:.17g}m2")
    assert ran.exit_code == 0, ran.output
    found = json.loads(ran.stdout)
    said = [one["message"] for one in found["problems"] if one["code"] == "face_closes"]
    assert len(said) == closes
    near = [one["code"] for one in found["problems"] if one["severity"] == "warning"]
    assert near == ["face_closes"] * closes + ["model_doubtful"]  # so near they press each other
    start = f"{100 * share:.0f} % of the face touches under 5 contacts"
    assert all(one.startswith(start) for one in said)


def test_contacts_of_more_area_than_the_joint_are_refused():
    ran = run(*PAIR, "--preload", "1e6", "--area", "1cm2")
    assert (ran.exit_code, ran.stdout, ran.stderr.count("\n")) == (3, "", 1)
    assert "1e+06 N need a contact area of 0.0283 m2 on a joint of 0.0001 m2" in ran.stderr
    assert run(*PAIR, "--preload", "1e6").exit_code == 0  # of no area nothing is known


@pytest.mark.parametrize("yields", [(), ("--set", "material.hardness_Pa=1e9")])
@pytest.mark.parametrize(("h", "touches"), [(0.999, True), (1.001, False), (1e6, False)])
def test_given_P_caps_that_do_not_touch_are_told_with_their_depth(h, touches, yields):
    """Under the load that brings the G-caps down by 255.1 nm, for h beside that, and in metres."""
    m, R, N, E_star_Pa = 5, 23.8, 460.0, 200e9 / (2 * (1 - 0.3**2))
    down_m = (0.75 * N / (m * E_star_Pa * R**0.5)) ** (2 / 3)
    ran = run(*PAIR[:8], "--h", repr(float(h * down_m)), "--preload", str(N), "--json", *yields)
    assert ran.exit_code == 0, ran.output
    found = json.loads(ran.stdout)
    said = [one["message"] for one in found["problems"] if one["code"] == "P_not_in_contact"]
    assert found["contact"]["contacts"] == (23 if touches else 5)
    assert len(said) == (not touches)
    told = f"{1e9 * h * down_m:.3g} nm" if h < 10 else f"{1e3 * h * down_m:.0f} mm"
    assert all(f"they lie {told} below" in one and "approach by 255 nm" in one for one in said)


def test_lengths_have_units_as_those_of_other_commands_have():
    """A number stays one in metres, as in the settings."""
    load = ("--preload", "460", "--json")
    plain = json.loads(run(*PAIR, *load).stdout)
    units = ("--radius-G", "23800mm", "--radius-P", "26.7 m", "--h", "0.24um")
    for h in ("0.24um", "240nm", "2.4e-4 mm"):
        ran = run("--m", "5", "--n", "18", *units[:5], h, *load)
        assert ran.exit_code == 0, ran.output
        slip = json.loads(ran.stdout)["slip"]
        for limit in ("limit_G_m", "limit_P_m"):
            assert slip[limit] == pytest.approx(plain["slip"][limit], rel=1e-12)
    by_approach = [run(*PAIR, "--approach", one, "--json") for one in ("250nm", "2.5e-7")]
    (one, other) = (json.loads(ran.stdout)["contact"] for ran in by_approach)
    assert one == other


@pytest.mark.parametrize("given", ["240furlong", "two um", "240nN", "-1nm"])
@pytest.mark.parametrize("option", ["--radius-G", "--radius-P", "--h", "--approach"])
def test_a_length_in_no_known_unit_is_named_with_its_option(option, given):
    ran = run(*PAIR, option, given)
    assert (ran.exit_code, ran.stderr.count("\n")) == (2, 1)
    assert f"{option}: got " in ran.stderr
    assert "its unit, one of" in ran.stderr


@pytest.mark.parametrize(
    ("m", "preload", "alone"), [(1, "460", True), (2, "460", False), (1, "1e6", False)]
)
def test_one_cap_that_carries_all_is_told_as_for_a_scan(m, preload, alone):
    """P-caps touch where they lie 240 nm below one G-cap, under the larger load."""
    families = (
        "--m",
        str(m),
        "--n",
        "18",
        *PAIR[4:8],
        "--h",
        "50um" if alone or m > 1 else "240nm",
    )
    found = json.loads(run(*families, "--preload", preload, "--json").stdout)
    assert found["contact"]["contacts"] == (m if preload == "460" else 19)
    said = [one for one in found["problems"] if one["code"] == "one_contact"]
    assert [one["severity"] for one in said] == ["warning"] * alone


def test_limits_of_solutions_that_families_do_not_need_are_told_as_not_used():
    given = ("--set", "contact.time_limit_s=5", "--set", "contact.solver_tolerance=1e-6")
    plain, limited = (json.loads(run(*PAIR, *more, "--json").stdout) for more in ((), given))
    (said,) = [one["message"] for one in limited["problems"] if one["code"] == "settings_ignored"]
    assert said.startswith("contact.time_limit_s, contact.solver_tolerance are not used")
    assert limited["slip"] == plain["slip"]


def test_families_beside_a_scan_are_refused():
    with pytest.raises(SettingsError, match=r"families\.m: got families together with a scan"):
        capslip.analyze(
            caps_map([(15e-3, 10e-3, 10.0, 0.0)]),
            capslip.load_settings(overrides=("families.m=5",)),
        )


def test_a_bulk_of_families_that_is_not_known_is_refused():
    ran = run(*PAIR, "--preload", "460", "--set", "contact.bulk=true")
    assert ran.exit_code == 2
    assert ran.stderr.startswith("error: contact.bulk: got true for families")


@pytest.mark.parametrize("model", MODELS)
def test_families_are_no_other_contact_model(model, tmp_path):
    """Settings and summary beside each other would say two."""
    sets = ("--set", f"contact.model={model}", "-o", str(tmp_path / "out"))
    ran = run(*PAIR, "--preload", "460", *sets)
    if model in ("auto", "families"):
        assert ran.exit_code == 0, ran.output
        return
    assert (ran.exit_code, ran.stdout, ran.stderr.count("\n")) == (2, "", 1)
    assert ran.stderr.startswith(f"error: contact.model: got {model} for families; expected")
    assert not (tmp_path / "out").exists()
