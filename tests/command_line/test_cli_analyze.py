"""The command line end to end on the sample faces."""

import csv
import json
import subprocess
import sys

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from capslip.caps.table import UNITS
from capslip.cli import main
from capslip.output.figures import OF_JOINT
from check_result import defects
from scenes import PROJECT

FACE = PROJECT / "sample_surfaces" / "paper_face_a.h5"
OTHER = FACE.with_name("paper_face_b.h5")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    out = tmp_path_factory.mktemp("analyze") / "face_a"
    ran = CliRunner().invoke(main, ["analyze", str(FACE), "-o", str(out), "--json"])
    assert ran.exit_code == 0, ran.output
    return out, json.loads(ran.stdout)


@pytest.mark.long
def test_the_result_is_complete(result):
    out, summary = result
    assert defects(out) == []
    assert json.loads((out / "summary.json").read_text()) == summary
    assert len(list((out / "figures").glob("*.png"))) >= 8


@pytest.mark.long
def test_both_families_are_found(result):
    _, summary = result
    assert (summary["families"]["m"], summary["families"]["n"]) == (2, 9)
    assert summary["families"]["G"]["radius_m"] == pytest.approx(23.8, rel=0.05)
    assert summary["families"]["P"]["radius_m"] == pytest.approx(26.7, rel=0.05)
    assert summary["families"]["h_m"] == pytest.approx(2.4e-7, rel=0.05)


@pytest.mark.long
def test_the_tables_agree(result):
    out, summary = result
    with h5py.File(out / "result.h5") as file:
        assert set(file["caps"]) == set(UNITS)
        every = []
        file.visititems(lambda _, item: every.append(item))
        assert all("unit" in item.attrs for item in every if isinstance(item, h5py.Dataset))
        force_N, energy_J = file["slip/force_N"][:], file["slip/energy_J"][:]
        load_N = file["caps/load_N"][:]
        labels = file["hills/labels"][:]
    assert labels.shape == tuple(summary["surface"]["shape"])
    assert len(force_N) >= 64
    assert force_N[[0, -1]] / summary["slip"]["total_slip_force_N"] == pytest.approx([1e-3, 1])
    assert (np.diff(energy_J) > 0).all()
    assert load_N.sum() == pytest.approx(summary["contact"]["preload_N"], rel=1e-9)
    with (out / "caps.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["load_N"]) for row in rows] == list(load_N)
    assert len(rows) == summary["hills"]["hills"]


@pytest.mark.long
def test_the_settings_of_a_result_repeat_it(result, tmp_path):
    out, summary = result
    arguments = ["analyze", str(FACE), "-c", str(out / "settings.toml"), "--no-figures"]
    again = CliRunner().invoke(
        main, [*arguments, "--no-render", "-o", str(tmp_path / "x"), "--json"]
    )
    assert again.exit_code == 0, again.output
    second = json.loads(again.stdout)
    for key in ("hills", "families", "accuracy", "problems"):
        assert second[key] == summary[key]
    for table, key in (("slip", "total_slip_displacement_m"), ("damping", "loss_factor")):
        assert second[table][key] == pytest.approx(summary[table][key], rel=1e-9)
    assert second["provenance"]["settings_sha256"] == summary["provenance"]["settings_sha256"]


@pytest.mark.long
def test_a_face_of_noise_is_a_result_without_an_answer(tmp_path):
    rng = np.random.default_rng(0)
    with h5py.File(tmp_path / "flat.h5", "w") as file:
        file["height"] = rng.normal(size=(60, 80))
        file["height"].attrs.update(unit="nm", pixel_size=[50.0, 50.0], pixel_unit="um")
    out = tmp_path / "out"
    ran = CliRunner().invoke(main, ["analyze", str(tmp_path / "flat.h5"), "-o", str(out), "--json"])
    # no caps, and as a map it is pressed flat: whole, and no number that anyone can use
    assert ran.exit_code == 3, ran.output
    summary = json.loads((out / "summary.json").read_text())
    assert summary["status"] == "failed"
    assert {"no_caps", "contact_failed"} <= {problem["code"] for problem in summary["problems"]}
    assert summary["contact"]["approach_m"] is None
    assert defects(out) == ["status failed"]
    assert (out / "caps.csv").read_text().splitlines() == [",".join(UNITS)]


def test_help_loads_nothing_heavy():
    code = (
        "import sys, capslip.cli; "
        "print([m for m in ('numpy', 'scipy', 'h5py', 'matplotlib') if m in sys.modules])"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert loaded.stdout.strip() == "[]"


@pytest.mark.long
def test_several_scans_give_one_joint_and_a_line_each(tmp_path):
    faces = [str(PROJECT / "sample_surfaces" / f"paper_face_{name}.h5") for name in "ab"]
    out = tmp_path / "joint"
    options = ["--set", "joint.area_m2=0.02", "--model", "caps", "-o", str(out)]
    ran = CliRunner().invoke(main, ["analyze", *faces, *options])
    assert ran.exit_code == 0, ran.output
    assert "from 2 scans, whose scatter rests on two: " in ran.stdout
    assert "2 scans together" in ran.stdout
    summary = json.loads((out / "summary.json").read_text())
    files = {str(path.relative_to(out)) for path in out.rglob("*.*")}
    figures = {f"figures/{name}.png" for name in OF_JOINT}
    assert files == {"summary.json", "settings.toml", "report.html", *figures}
    for scan in summary["scans"]:
        assert f"{scan['name']}: " in ran.stdout
        assert scan["sha256"]
        assert scan["answer"]["energy_J"] > 0.0
    again = CliRunner().invoke(main, ["analyze", faces[0], faces[0], *options])
    assert again.exit_code == 2
    assert "expected another place of the joint" in again.stderr  # the scatter would be none
    low, high = summary["answer"]["interval"]["energy_J"]
    assert low < summary["answer"]["energy_J"] < high
    assert summary["answer"]["contributions"]["energy_J"]["scans"] > 0.0
    again = CliRunner().invoke(
        main, ["analyze", *faces, *options, "--json", "-q", "--set", "run.figures=false"]
    )
    assert json.loads(again.stdout)["scans"] == summary["scans"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "joint.area_m2: got 2 scans"),
        (["--mate", str(FACE)], "--mate: got 2 scans"),
    ],
)
def test_what_several_scans_cannot_have_is_refused(options, says, tmp_path):
    ran = CliRunner().invoke(
        main, ["analyze", str(FACE), str(OTHER), "-o", str(tmp_path / "x"), *options]
    )
    assert ran.exit_code == 2
    assert says in ran.stderr
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "joint.area_m2: got 3 scans"),
        (("joint.area_m2=1", "slip.normal_amplitude_ratio=0.3"), "ratio: got 0.3 with 3 scans"),
        (("joint.area_m2=1", "contact.model=flat"), "contact.model: got flat with 3 scans"),
    ],
)
def test_settings_of_which_scans_make_no_joint_are_refused_before_one_is_read(
    words, says, tmp_path, monkeypatch
):
    """Of hundreds of scans that is a long time for nothing."""

    def read(*given, **more):
        raise AssertionError("a scan was read")

    monkeypatch.setattr("capslip.cli._load", read)
    faces = [str(FACE), str(OTHER), str(FACE)]
    options = [word for one in words for word in ("--set", one)]
    ran = CliRunner().invoke(main, ["analyze", *faces, "-o", str(tmp_path / "x"), *options])
    assert ran.exit_code == 2
    assert says in ran.stderr
