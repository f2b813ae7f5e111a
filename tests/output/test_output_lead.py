"""What a reader sees first, to the letter: each number at its place, in its unit."""

import pytest

from capslip.output.lead import (
    _left_out,
    answer_lines,
    assumed_lines,
    causes,
    joint_line,
    moved_by,
)
from capslip.problems import KINDS

ANSWER = {
    "asked": {"quantity": "displacement_m", "value": 3e-8, "by_default": False},
    "structure": "beam",
    "slip_force_N": 20.0,
    "displacement_m": 3e-8,
    "tangential_stiffness_N_per_m": 7e8,
    "energy_J": 4e-9,
    "joint_loss_factor": 0.05,
    "amplitude_m": 5e-7,
    "total_amplitude_m": 6e-7,
    "loss_factor": 0.006,
    "damping_ratio": 0.003,
    "frequency_shift": -0.04,
    "total_loss_factor": 0.0055,
    "interval": {
        "tangential_stiffness_N_per_m": [6e8, 8e8],
        "energy_J": [3e-9, 9e-9],
        "joint_loss_factor": [0.04, 0.11],
        "loss_factor": [0.005, 0.013],
    },
    "contributions": {
        "tangential_stiffness_N_per_m": {"model": 1.0},
        "energy_J": {"preload": 0.247, "friction": 0.743, "model": 0.005, "hardness": 0.0049},
    },
    "not_in_interval": ["noise of the map", "what a_doubt moves"],
}
SLIP = {"total_slip_force_N": 80.0, "total_slip_displacement_m": 9e-7}
SUMMARY = {"slip": SLIP, "assumed": [{"setting": "slip.normal_amplitude_ratio"}], "scans": None}
LOSS = "tangential stiffness 700 MN/m (secant), 4 nJ lost per cycle, loss factor of the joint 0.05"
STATE = "slip force 20 N, displacement 30 nm; gross slip at 80 N, 900 nm"
STRUCTURE = (
    "beam: loss factor 0.006, damping ratio 0.003, frequency -4 %, at amplitude 500 nm with rigid "
    "joints"
)
WHOLE = (
    "with all that the joints move and store, as a decay shows it: loss factor 0.0055 at amplitude "
    "600 nm"
)
INTERVAL = (
    "90 % interval: stiffness 600 MN/m to 800 MN/m, energy 3 nJ to 9 nJ, loss factor of the joint "
    "0.04 to 0.11, of the structure 0.005 to 0.013"
)
MODEL_FORM = "beside it, dissipation of real joints is known to a factor of two to three at best"
PARTS = (
    "what makes that of the energy: friction 74 %, preload 25 %, model 0 %; it leaves out noise of "
    f"the map and the effect of a_doubt; {MODEL_FORM}"
)


def lines(absent="-", **answer):
    """Return the texts of an answer that differs from the one above."""
    found = answer_lines(SUMMARY | {"answer": ANSWER | answer}, absent)
    assert [label for label, _ in found] == ["answer", *[""] * (len(found) - 1)]
    return [text for _, text in found]


def asked(quantity, by_default=False):
    return {"asked": {"quantity": quantity, "value": 1.0, "by_default": by_default}}


def test_an_answer_is_these_lines():
    at = "at displacement 30 nm of the joint"
    assert lines() == [at, LOSS, STATE, STRUCTURE, WHOLE, INTERVAL, PARTS]


@pytest.mark.parametrize(
    ("quantity", "at", "state"),
    [
        ("amplitude_m", "at amplitude 500 nm of the beam", STATE),
        ("displacement_m", "at displacement 30 nm of the joint", STATE),
        ("slip_force_N", "at slip force 20 N", STATE.removeprefix("slip force 20 N, ")),
    ],
)
def test_what_was_asked_leads_and_is_not_said_twice(quantity, at, state):
    assert lines(**asked(quantity)) == [at, LOSS, state, STRUCTURE, WHOLE, INTERVAL, PARTS]
    default = " (a quarter of gross slip: nothing was asked)"
    assert lines(**asked(quantity, by_default=True))[0] == at + default


def test_a_structure_that_is_not_lightly_damped_has_no_loss_factor():
    found = lines(loss_factor=None, damping_ratio=None)
    assert found[3] == (
        "beam: loss factor not defined at amplitude 500 nm with rigid joints, frequency -4 %: the "
        "mode is no longer lightly damped"
    )
    assert found[4] == WHOLE  # softer joints store more, and what is lost may be little of it
    assert found[5] == INTERVAL.partition(", of the structure")[0]
    found = lines(loss_factor=None, damping_ratio=None, total_loss_factor=None)
    assert found[4] == INTERVAL.partition(", of the structure")[0]


@pytest.mark.parametrize(
    ("ends", "said"),
    [
        ([3e-9, 9e-9], "energy 3 nJ to 9 nJ"),
        ([1.13e-20, 9e-9], "energy less than 1 fJ to 9 nJ"),
        ([1.1e-15, 9e-9], "energy 1.1 fJ to 9 nJ"),
        ([3e-9, None], "energy above 3 nJ, no upper bound"),
        ([None, None], "energy without a bound"),
        ([0.0, None], "energy without a bound"),
        ([0.0, 9e-9], "energy 0 J to 9 nJ"),  # less than a millionth of it
        (None, "energy without a bound"),
    ],
)
def test_an_end_of_an_interval_that_is_not_known_is_said(ends, said):
    found = lines(interval=ANSWER["interval"] | {"energy_J": ends})
    assert found[5] == INTERVAL.replace("energy 3 nJ to 9 nJ", said)


def test_a_number_that_nothing_moves_has_no_interval():
    found = lines(interval=ANSWER["interval"] | {"tangential_stiffness_N_per_m": [7e8, 7e8]})
    assert found[5] == INTERVAL.replace("stiffness 600 MN/m to 800 MN/m, ", "")


@pytest.mark.parametrize("shares", [{}, {"friction": 0.0}])
def test_an_interval_without_a_bound_has_no_parts_and_one_with_a_bound_says_why(shares):
    of = {"contributions": {"energy_J": shares}, "not_in_interval": None}
    for ends in ([3e-9, None], None):
        found = lines(**of, interval=ANSWER["interval"] | {"energy_J": ends})
        assert found[6] == f"no upper bound; {MODEL_FORM}"
    beyond = "what makes that of the energy is not known: some of what may be is beyond gross slip"
    assert lines(**of)[6] == f"{beyond}; {MODEL_FORM}"


def test_an_energy_of_which_nothing_is_known_has_no_parts_and_says_so():
    known = ANSWER["interval"] | {"energy_J": [0.0, 9e-9], "joint_loss_factor": [0.0, 1.27]}
    found = lines(contributions={"energy_J": {}}, not_in_interval=None, interval=known)
    assert "energy 0 J to 9 nJ, loss factor of the joint 0 to 1.27" in found[5]
    none = "of the energy nothing is known but that it is no more than the rectangle of its loop"
    assert found[6] == f"{none}; {MODEL_FORM}"


@pytest.mark.parametrize(
    ("energy_J", "said"),
    [
        ([0.0, 0.0], "nothing slips under any friction that may be, and no energy is lost"),
        ([0.0, 9e-9], "under some of what may be nothing slips, and no energy is lost"),
        ([0.0, None], "no upper bound"),
    ],
)
def test_under_a_load_that_oscillates_an_energy_may_be_none(energy_J, said):
    """In phase nothing slips below mu times its amplitude, and that is known."""
    known = {"contributions": {"energy_J": {}}, "not_in_interval": None}
    known["interval"] = ANSWER["interval"] | {"energy_J": energy_J}
    found = answer_lines(SUMMARY | {"assumed": [], "answer": ANSWER | known}, "-")
    assert found[6] == ("", f"{said}; {MODEL_FORM}")


def test_no_interval_is_a_reason_but_for_an_answer_of_nothing():
    assert lines(contributions=None, energy_J=0.0)[5:] == []
    known = {"accuracy": {"estimated": None}, "answer": ANSWER | {"contributions": None}}
    (*_, (_, why)) = answer_lines(SUMMARY | known, "-")
    assert why.startswith("no interval: the error of the model is not known")


def test_without_an_answer_the_end_of_the_joint_is_said_where_it_slips():
    none = dict.fromkeys(ANSWER)
    assert lines(**none) == ["none; gross slip at 80 N, 900 nm"]
    stuck = {"answer": none, "slip": dict.fromkeys(SLIP)}
    assert answer_lines(SUMMARY | stuck, "-") == [("answer", "none: see the problems")]


def test_a_number_that_there_is_not_is_what_the_place_writes_for_it():
    assert lines("n/a", damping_ratio=None)[3] == STRUCTURE.replace("ratio 0.003", "ratio n/a")


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ([], ""),
        (["what a moves"], "; it leaves out the effect of a"),
        (["what a moves", "what b moves"], "; it leaves out the effect of a and b"),
        (["what a moves", "x", "what b moves", "what c moves"],
         "; it leaves out x and the effect of a, b and c"),
    ],
)  # fmt: skip
def test_doubts_that_an_interval_leaves_out_are_one_list(names, said):
    assert _left_out(names) == said


CONTACT = {
    "preload_N": 460.0,
    "joint_area_m2": 2e-3,
    "scan_area_m2": 6e-4,
    "nominal_pressure_Pa": 2.3e5,
    "coverage": 0.3,
    "resultant_off_load_point_m": 4e-6,
}


@pytest.mark.parametrize(
    ("changes", "scans", "said"),
    [
        ({}, None, "preload 460 N on 20 cm²: 230 kPa nominal; scan 30 % of it, "
         "resultant 4 µm off the load point"),
        ({"resultant_off_load_point_m": 0.0}, None, "preload 460 N on 20 cm²: 230 kPa nominal; "
         "scan 30 % of it, resultant through the load point"),
        ({"resultant_off_load_point_m": 0.0, "coverage": 0.6}, None, "preload 460 N on 20 cm²: "
         "230 kPa nominal; scan 60 % of what bears it, resultant through the load point"),
        ({"resultant_off_load_point_m": None, "coverage": None}, None,
         "preload 460 N on 20 cm²: 230 kPa nominal"),
        (dict.fromkeys(CONTACT) | {"preload_N": 460.0}, None, "preload 460 N"),
        ({}, [{"share": 0.5}, {"share": 0.5}],
         "preload 460 N on 20 cm²: 230 kPa nominal; 2 scans together 30 % of it"),
        ({}, [{"share": 0.2}, {"share": None}, {"share": 0.8}],
         "preload 460 N on 20 cm²: 230 kPa nominal; 2 of 3 scans together 30 % of it"),
    ],
)  # fmt: skip
def test_the_line_of_the_joint(changes, scans, said):
    assert joint_line({"contact": CONTACT | changes, "scans": scans}, "-") == said


def problem(code, severity="warning", message="it is", **effect):
    known = {"tangential_stiffness": None, "energy": None, "loss_factor": None} | effect
    return {
        "code": code,
        "severity": severity,
        "message": message,
        "effect": known if effect else None,
    }


def test_what_a_problem_does_is_measured_or_that_of_its_kind_and_said_once():
    moving = problem("bow_left", tangential_stiffness=0.1, energy=0.2, loss_factor=0.3)
    said = "moves the stiffness by 10 %, the energy by 20 %, the loss factor by 30 %"
    assert moved_by(moving) == said
    assert moved_by(problem("bow_left", energy=0.2)) == "moves the energy by 20 %"
    assert moved_by(problem("bow_left")) == ""
    itself = problem("spikes", message="which moves the stiffness by 10 %", energy=0.2)
    told = causes({"problems": [moving, problem("spikes"), itself, problem("seams", "info")]})
    by_message = {(one["code"], one["message"]): one["does"] for one in told}
    assert by_message == {
        ("bow_left", "it is"): said,
        ("spikes", "it is"): KINDS["spikes"].effect,
        ("spikes", itself["message"]): "",
    }


def test_causes_are_ranked_by_the_greatest_of_their_effects():
    each = [
        problem("spikes", loss_factor=0.2),
        problem("bow_left", tangential_stiffness=0.3, energy=0.01),
        problem("seams", energy=0.25, loss_factor=0.1),
        problem("clipped", energy=0.1),
    ]
    assert [one["code"] for one in causes({"problems": each})] == ["bow_left", "seams", "spikes"]
    assert {one["code"] for one in causes({"problems": each}, most=None)} == {
        one["code"] for one in each if one["severity"] != "info"
    }


def test_causes_are_errors_then_what_spoils_every_number_then_by_effect_and_no_notes():
    each = [
        problem("clipped", "info", energy=9.0),
        problem("spikes", energy=3.0),
        problem("tips_over", energy=0.1),
        problem("contact_failed", "error"),
    ]
    assert KINDS["tips_over"].spoils_all
    ranked = ["contact_failed", "tips_over", "spikes"]
    assert [one["code"] for one in causes({"problems": each})] == ranked


def test_what_was_assumed_is_its_name_its_value_and_what_it_moves():
    assumed = {"name": "friction", "setting": "material.mu", "value": "0.2", "moves": "energy"}
    assert assumed_lines({"assumed": [assumed]}) == [("friction", "0.2", "energy")]
