"""The summary of a result: what is counted, what is left out, and what is shown."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.analysis import analyze
from capslip.caps.table import CapFlag
from capslip.problems import Problem
from capslip.result import _cell
from capslip.summary import _limit, alignment_table, contact_table, hills_table, plain


@pytest.mark.parametrize(
    ("severities", "status"),
    [
        ([], "ok"),
        (["info"], "ok"),
        (["info", "warning"], "check"),
        (["warning", "error"], "failed"),
        (["error"], "failed"),
    ],
)
def test_the_status_is_that_of_the_worst_problem(severities, status, several):
    codes = {"info": "one_family", "warning": "no_caps", "error": "contact_failed"}
    problems = tuple(Problem(codes[one], one, "") for one in severities)
    assert replace(several, problems=problems).status == status


def test_hills_without_a_sphere_are_counted_as_rejected(several):
    flags = several.caps.flags.copy()
    flags[:2] = CapFlag.not_convex
    caps = several.caps.with_columns(flags=flags)
    hills = replace(several.hills, rejected={"too_few_points": 3})
    found = replace(several, caps=caps, hills=hills).summary()["hills"]
    assert (found["caps"], found["hills"]) == (3, 5)
    assert found["rejected"] == {"too_few_points": 3, "no_sphere": 2}
    assert hills.rejected == {"too_few_points": 3}
    assert replace(several, hills=hills).summary()["hills"]["rejected"] == hills.rejected


def test_the_share_of_lost_points_is_that_of_the_scan(several):
    lost = several.surface
    expected = 1.0 - np.count_nonzero(lost.measured) / lost.height_m.size
    assert several.summary()["surface"]["non_measured_fraction"] == pytest.approx(expected)
    assert expected == pytest.approx(20 * 40 / 60000)


def test_the_limit_of_a_family_is_that_of_the_last_of_its_contacts():
    contact = SimpleNamespace(row_family=np.array(["G", "P", "G", "P", "G"]))
    slip = SimpleNamespace(limits_m=np.array([1.0, 2.0, 3.0, np.nan, np.inf]))
    analysis = SimpleNamespace(contact=contact, slip=slip)
    assert (_limit(analysis, "G"), _limit(analysis, "P")) == (3.0, 2.0)
    slip.limits_m = np.array([1.0, np.nan, 3.0, np.nan, 2.0])
    assert (_limit(analysis, "G"), _limit(analysis, "P")) == (3.0, None)
    assert _limit(analysis, "") is None
    assert _limit(SimpleNamespace(contact=None, slip=slip), "G") is None
    assert _limit(SimpleNamespace(contact=contact, slip=None), "G") is None


def test_what_is_plain():
    values = {
        "array": np.array([[1.0, np.nan], [np.inf, 2.0]]),
        "numpy": np.float64(0.5),
        "count": np.int64(3),
        "truth": np.bool_(True),
        "nested": ({"bad": -np.inf}, "word", None, 7),
    }
    found = plain(values)
    assert found == {
        "array": [[1.0, None], [None, 2.0]],
        "numpy": 0.5,
        "count": 3,
        "truth": True,
        "nested": [{"bad": None}, "word", None, 7],
    }
    assert [type(found[key]) for key in ("numpy", "count", "truth")] == [float, int, bool]


@pytest.mark.parametrize(
    ("value", "text"), [(None, "–"), (0.123456, "0.1235"), (12, "12"), ("<b>", "&lt;b&gt;")]
)
def test_how_a_cell_of_the_table_is_written(value, text):
    assert _cell(value) == text


@pytest.mark.parametrize(
    ("level_slope", "tilt_rad", "expected", "alignment"),
    [
        (None, (0.0, 0.0), (0.0, 0.0), "as_levelled"),
        (None, (0.0, -2e-6), (0.0, -2e-6), "balanced"),
        (np.array([3e-6, 1e-6]), (0.0, 0.0), (3e-6, 1e-6), "balanced"),
        (np.array([3e-6, 1e-6]), (1e-6, -2e-6), (4e-6, -1e-6), "balanced"),
    ],
)
def test_the_tilt_is_that_of_level_and_contact_together(
    level_slope, tilt_rad, expected, alignment, several
):
    """The face is 30 mm along x and 20 mm along y."""
    level = None if level_slope is None else SimpleNamespace(slope=level_slope)
    contact = replace(several.contact, tilt_rad=tilt_rad)
    found = alignment_table(replace(several, contact=contact, level=level))
    assert found["tilt_rad"] == pytest.approx(expected)
    across_m = 0.03 * abs(expected[0]) + 0.02 * abs(expected[1])
    assert found["tilt_across_face_m"] == pytest.approx(across_m)
    assert found["alignment"] == alignment


@pytest.mark.parametrize(("missed_area_m2", "certified"), [(0.0, True), (1e-12, False)])
def test_a_cut_is_certified_where_no_area_that_touches_was_missed(
    missed_area_m2, certified, several
):
    chosen = several.settings.hills.material_ratio
    found = hills_table(replace(several, level=None))
    assert (found["material_ratio"], found["cut_certified"]) == (chosen, None)
    level = SimpleNamespace(material_ratio=0.5 * chosen, missed_area_m2=missed_area_m2)
    found = hills_table(replace(several, level=level))
    assert (found["material_ratio"], found["cut_certified"]) == (0.5 * chosen, certified)


def test_areas_of_contact_are_those_of_all_patches_of_an_even_joint(several):
    contact = replace(several.contact, contact_area_m2=3e-6, yielded_area_m2=1e-6)
    joint = replace(several.joint, weight=np.array([4.0]))
    found = contact_table(replace(several, contact=contact, joint=joint))
    assert (found["contact_area_m2"], found["yielded_area_m2"]) == pytest.approx((12e-6, 4e-6))
    uneven = replace(joint, weight=np.array([2.0, 2.0]), load_N=np.array([150.0, 50.0]))
    found = contact_table(replace(several, contact=contact, joint=uneven))
    assert (found["contact_area_m2"], found["yielded_area_m2"]) == (None, None)


def test_a_loss_factor_is_told_where_the_mode_is_lightly_damped(several):
    loss = np.full(several.damping.loss_factor.shape, 0.1)
    loss[:3] = 0.3, 0.303, np.inf
    damping = replace(several.damping, loss_factor=loss)
    found = replace(several, damping=damping).summary()["damping"]
    assert found["loss_factor"] == [0.3, None, None, *loss[3:]]
    assert [one is None for one in found["damping_ratio"]] == [
        loss_i is None for loss_i in found["loss_factor"]
    ]


def test_seconds_from_outside_stand_beside_those_of_the_stages(several):
    found = several.summary("capslip", {"read": 1.5})
    assert found["timings_s"] == {**several.timings_s, "read": 1.5}
    assert found["provenance"]["command"] == "capslip"


OF_THE_JOINT = {"preload_N", "nominal_pressure_Pa", "coverage", "joint_area_m2", "scan_area_m2"}
OF_THE_JOINT |= {"scan_load_N", "pressure_classes"}


def test_stages_that_could_not_run_are_absent(several):
    failed = replace(several, contact=None, slip=None, damping=None, sensitivity=None)
    found = failed.summary()
    assert found["contact"]["preload_N"] == 150.0
    assert found["damping"]["joints"] == several.settings.structure.joints
    for table, kept in (
        ("contact", OF_THE_JOINT),
        ("slip", {"friction_coefficient"}),
        ("damping", {"joints", "structure"}),
        ("accuracy", {"requested"}),
    ):
        assert {key for key, value in found[table].items() if value not in (None, [])} == kept
    assert "no contact" in repr(failed)
    assert [part.share for part in several.parts] == [1.0]
    assert failed.parts == replace(several, slip=None).parts == ()
    assert "no loss factor" in repr(failed)


def test_a_resultant_that_is_off_by_nothing_of_the_face_is_on_the_load_point(several):
    for off_m, said_m in ((5e-18, 0.0), (1.45e-9, 0.0), (1e-6, 1e-6)):
        contact = replace(several.contact, eccentricity_m=(off_m, 0.0))
        found = replace(several, contact=contact).summary()["contact"]
        assert found["resultant_off_load_point_m"] == said_m


def test_each_stage_is_told_once_as_it_begins(several):
    told = []
    found = analyze(several.surface, several.settings, progress=told.append)
    stages = [line.removeprefix("analysing: ").partition(",")[0] for line in told]
    assert stages[0] == "condition"
    assert sorted(stages) == sorted(found.timings_s)
    # What doubts move may press the map again, which was told as damping
    assert stages[stages.index("damping") + 1] == "effects"
