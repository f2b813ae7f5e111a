"""The one table of quantities: every place exists, and every way of writing is right."""

from dataclasses import replace

import numpy as np
import output_cases
import pytest

from capslip.caps.iso25178 import Iso25178
from capslip.output import report
from capslip.output.quantity import engineering, scaled
from capslip.output.rows import QUANTITIES, SCALES, Value, value, write_text
from capslip.output.terminal import result_lines
from capslip.problems import Problem
from capslip.surface.heightmap import HeightMap
from capslip.units import percent

SUFFIX = {"m": "_m", "N": "_N", "N/m": "_N_per_m", "Pa": "_Pa", "J": "_J", "m^2": "_m2"}
SUFFIX |= {"1/m^2": "_per_m2", "1/m": "_per_m", "rad": "_rad"}


@pytest.mark.parametrize("case", [output_cases.none, output_cases.one, output_cases.several])
def test_every_quantity_has_a_place_in_every_summary(case):
    summary = case().summary()
    for name in QUANTITIES:
        value(summary, name)


def test_the_unit_is_that_of_the_key():
    for name, quantity in QUANTITIES.items():
        key = [key for key in quantity.path.split(".") if not key.isdigit()][-1]
        units = [unit for unit, suffix in SUFFIX.items() if key.endswith(suffix)]
        if units and key not in ("m", "n"):
            assert quantity.unit == max(units, key=lambda unit: len(SUFFIX[unit])), name
        else:
            assert quantity.unit in ("", "%"), name


def test_values_are_those_of_the_analysis():
    analysis = output_cases.several()
    summary, families = analysis.summary(), analysis.families
    limit_m = {
        name: analysis.slip.limits_m[analysis.caps.family[analysis.contact.use] == name].max()
        for name in "GP"
    }
    assert limit_m["G"] > limit_m["P"] > 0
    expected = {
        "m": families.m,
        "n": families.n,
        "h_m": families.h_m,
        "radius_G_m": families.G.radius_m,
        "diameter_P_m": families.P.diameter_m,
        "height_G_m": families.G.height_m,
        "peak_height_P_m": families.P.peak_height_m,
        "cut_height_m": analysis.hills.cut_height_m,
        "approach_m": analysis.contact.approach_m,
        "approach_without_bulk_m": analysis.contact.approach_without_bulk_m,
        "stiffness_N_per_m": analysis.contact.stiffness_N_per_m,
        "tangential_stiffness_N_per_m": analysis.slip.tangential_stiffness_N_per_m,
        "total_slip_force_N": analysis.slip.total_slip_force_N,
        "gross_slip_amplitude_m": analysis.damping.gross_slip_amplitude_m,
        "limit_G_m": limit_m["G"],
        "limit_P_m": limit_m["P"],
        "max_pressure_Pa": analysis.contact.max_pressure_Pa,
        "contact_area_m2": analysis.contact.contact_area_m2,
        "amplitude_at_peak_m": analysis.damping.amplitude_at_peak_m,
        "modal_stiffness_N_per_m": analysis.damping.modal_stiffness_N_per_m,
        "joint_stiffness_N_per_m": analysis.damping.joint_stiffness_N_per_m,
        "sq_m": analysis.conditioned.sq_m,
        "sz_m": analysis.conditioned.sz_m,
    }
    assert {name: value(summary, name) for name in expected} == expected


@pytest.mark.parametrize(
    ("found", "unit", "spec", "text"),
    [
        (2.345e-7, "m", "", "234 nm"),
        (2.3456e-7, "m", "4", "234.6 nm"),
        (2.3456e-7, "m", "um", "0.2346 um"),
        (2.3456e-7, "m", ".2f um", "0.23 um"),
        (1.5e-3, "m", "mm", "1.5 mm"),
        (25.0, "m", ".4g m", "25 m"),
        (7.6e-8, "m", "nm", "76 nm"),
        (4.245e9, "N/m", "MN/m", "4245 MN/m"),
        (0.2149, "%", "", "21.5 %"),
        (0.2149, "%", ".0f %", "21 %"),
        (3.07e-6, "m^2", "", "3.07 mm²"),
        (2.73e-11, "m^2", "", "27.3 µm²"),
        (0.0, "m^2", "", "0 µm²"),
        (1.2e-3, "m^2", "", "12 cm²"),
        (0.051449, "", "", "0.0514"),
        (0.051449, "", ".4g", "0.05145"),
        (11, "", "", "11"),
        ("caps", "", "", "caps"),
        (None, "m", "um", "–"),
        (None, "", "", "–"),
    ],
)
def test_how_a_value_is_written(found, unit, spec, text):
    assert format(Value(found, unit), spec) == text


@pytest.mark.parametrize(
    ("found", "text"),
    [(1000.0, "1 kN"), (1e-6, "1 µN"), (999.4, "999 N"), (-2e6, "-2 MN"), (1e-18, "0.001 fN")],
)
def test_a_prefix_changes_at_a_thousand(found, text):
    assert format(Value(found, "N"), "") == text


@pytest.mark.parametrize(("power", "prefix"), [*zip(range(-15, 15, 3), "fpnµm kMGT", strict=True)])
def test_every_prefix_is_that_of_its_power(power, prefix):
    assert engineering(3.21 * 10.0**power, "N") == f"3.21 {prefix.strip()}N"
    assert engineering(-999.0 * 10.0**power, "N") == f"-999 {prefix.strip()}N"
    values, unit = scaled(np.array([np.nan, -2.0, 50.0]) * 10.0**power, "N")
    assert unit == f"{prefix.strip()}N"
    assert values == pytest.approx([np.nan, -2.0, 50.0], nan_ok=True)


def test_beyond_the_prefixes_the_last_one_stays():
    assert engineering(1e-17, "N") == "0.01 fN"
    assert engineering(1e15, "N") == "1e+03 TN"
    assert engineering(12.346, "N", 4) == "12.35 N"
    assert [engineering(x, "N") for x in (np.inf, np.nan, None)] == ["–"] * 3
    assert scaled([0.0, np.nan], "N")[1] == scaled([], "N")[1] == "N"


def test_scales_are_those_of_their_prefix():
    assert {name: scale for name, scale in SCALES.items() if name != "µm"} == {
        "um": 1e-6,
        "nm": 1e-9,
        "nJ": 1e-9,
        "mm": 1e-3,
        "µm²": 1e-12,
        "mm²": 1e-6,
        "cm²": 1e-4,
        "MN/m": 1e6,
        "%": 1e-2,
        "°": np.pi / 180.0,
        "1/mm": 1e3,
        "1/mm²": 1e6,
    }
    assert SCALES["µm"] == SCALES["um"]


def test_an_unknown_quantity_is_an_error_of_the_program():
    with pytest.raises(KeyError, match="nothing"):
        write_text("{nothing}", {})


def test_the_lines_of_a_terminal():
    analysis = output_cases.several()
    fresh = replace(analysis, iso25178=Iso25178(analysis.conditioned))
    lines = result_lines(fresh).splitlines()
    assert set(vars(fresh.iso25178)) == {"conditioned"}  # no line shows what takes longest
    assert lines[0] == f"verdict    {analysis.verdict}"
    assert lines[1].startswith("answer     at slip force 7.5 N (a quarter of gross slip")
    lines = lines[[line[:4] for line in lines].index("scan") :]
    families, slip, damping = analysis.families, analysis.slip, analysis.damping
    assert lines[0].startswith("scan       ")

    def human(value, unit, digits=3):
        return engineering(value, unit, digits).replace("µ", "u")

    assert f"cut {human(analysis.hills.cut_height_m, 'm')}, " in lines[1]
    assert lines[2] == f"families   m 2, n 3, h {human(families.h_m, 'm')}"
    for line, name, family in ((lines[3], "G", families.G), (lines[4], "P", families.P)):
        assert line == (
            f"  {name}        R {human(family.radius_m, 'm', 4)}, "
            f"D {human(family.diameter_m, 'm')}, "
            f"df {human(family.height_m, 'm')}"
        )
    contact = analysis.contact
    assert lines[5] == (  # the approach without bulk first, as in the report
        f"contact    caps: 150 N on {contact.contacts} caps in contact, approach "
        f"{human(contact.approach_without_bulk_m, 'm')} ({human(contact.approach_m, 'm')} "
        "with bulk)"
    )
    assert lines[6] == (
        f"slip       stiffness {human(slip.tangential_stiffness_N_per_m, 'N/m')}, gross slip at "
        f"{human(slip.total_slip_force_N, 'N', 4)}, {human(slip.total_slip_displacement_m, 'm')}"
    )
    assert lines[7] == (
        "damping    demonstration beam 400 x 60 x 40 mm: peak loss factor "
        f"{damping.peak_loss_factor:.4g} at "
        f"{human(damping.amplitude_at_peak_m, 'm')}, gross slip at "
        f"{human(damping.gross_slip_amplitude_m, 'm')}"
    )
    assert lines[8] == f"status     {analysis.status}"


def test_the_load_of_a_joint_pressed_unevenly_is_named_for_what_it_is():
    even = output_cases.several()
    two = replace(even.joint, load_N=np.repeat(even.joint.load_N, 2), weight=np.full(2, 0.5))
    contact = [
        next(line for line in result_lines(one).splitlines() if line.startswith("contact"))
        for one in (even, replace(even, joint=two))
    ]
    assert contact[1] == f"{contact[0]}, under the greatest pressure"


def test_the_terminal_says_of_a_face_that_yielded_what_of_its_approach_is_elastic():
    elastic = output_cases.several()
    known = replace(elastic.contact, approach_m=6e-7, bulk_m=1e-7)
    for given, said in (
        ({}, "approach 500 nm (600 nm with bulk)"),
        (
            {"yielded_area_m2": 1e-6, "left_m": 2e-7},
            "approach on first loading 700 nm (800 nm with bulk), "
            "recovers 500 nm (600 nm with bulk) on unloading",
        ),
        ({"yielded_area_m2": 1e-6}, "recovers 500 nm (600 nm with bulk) on unloading"),
        ({"yielded_area_m2": 1e-6, "bulk_m": 7e-7}, "recovers 600 nm on unloading"),
    ):
        lines = result_lines(replace(elastic, contact=replace(known, **given))).splitlines()
        line = next(line for line in lines if line.startswith("contact"))
        assert line.endswith(f" caps in contact, {said}")


def test_a_code_that_warns_is_not_noted_beside_it():
    codes = (("one_family", "info"), ("few_contacts_in_scan", "warning"))
    both = [Problem("small_slip_extrapolated", severity, "so") for severity in ("info", "warning")]
    known = [*(Problem(*one, "so") for one in codes), *both]
    for problems, noted in ((known, ["one_family"]), (both, [])):
        lines = result_lines(replace(output_cases.several(), problems=tuple(problems))).splitlines()
        named = [line.split()[1] for line in lines if line.startswith("  info")]
        assert [name.rstrip(":") for name in named] == noted


def test_the_terminal_names_a_note_once_however_often_it_was_found():
    note = Problem("small_slip_extrapolated", "info", "so")
    found = replace(output_cases.several(), problems=(note, note))
    assert (
        result_lines(found).splitlines()[-1] == "  info     small_slip_extrapolated: see the report"
    )


def test_the_terminal_says_what_is_absent_in_plain_letters():
    lines = result_lines(output_cases.none()).splitlines()
    lines = lines[[line[:4] for line in lines].index("scan") :]
    assert lines[2] == "families   m 0, n 0, h -"
    assert lines[3].startswith("status ")


def test_terminal_and_report_tell_the_map_as_read_from_the_map_as_analysed(several):
    """Read: 300 x 200 points of 0.1 mm; analysed: half as many along either axis."""
    same = several.surface
    coarse = HeightMap(same.height_m[::2, ::2].copy(), (2e-4, 2e-4), same.origin)
    for surface, known in ((same, False), (coarse, True)):
        conditioned = replace(several.conditioned, surface=surface)
        analysis = replace(several, conditioned=conditioned)
        lines = result_lines(analysis).splitlines()
        at = [line[:4] for line in lines].index("scan")
        scan = [line[11:] for line in lines[at : at + 2]]
        assert scan[0].startswith(
            "as read: 300 x 200 points of 100 x 100 um" if known else "300 x 200"
        )
        assert ("; Sq " in scan[0]) != known
        assert scan[1].startswith("as analysed: 150 x 100 points of 200 x 200 um") == known
        assert ("; Sq " in scan[1]) == known
        page = report._tables(analysis.summary(), report._changed(analysis))
        face = dict(dict(page)["Height map"])
        assert face["points, as read" if known else "points"] == "300 x 200 (x, y)"
        assert face["pixel, as read" if known else "pixel"] == "100 µm x 100 µm"
        assert ("non-measured, as read" in face) == known == ("non-measured" not in face)
        missing = percent(float(np.isnan(coarse.height_m).mean()))
        expected = f"150 x 100 (x, y), pixels of 200 µm x 200 µm, {missing} non-measured"
        assert face.get("as analysed") == (expected if known else None)


def test_a_map_that_lost_points_on_the_way_is_told_from_the_one_that_was_read(several):
    height_m = several.surface.height_m.copy()
    height_m[:20] = np.nan
    fewer = HeightMap(height_m, several.surface.pixel_size_m, several.surface.origin)
    found = replace(several, conditioned=replace(several.conditioned, surface=fewer))
    assert report._changed(found) is fewer
    assert report._changed(several) is None
