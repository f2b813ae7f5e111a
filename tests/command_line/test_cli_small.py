"""The small commands."""

import json

import pytest
from click.testing import CliRunner

import capslip
from capslip.cli import main
from scenes import PROJECT

FACE_A, FACE_B = (PROJECT / "sample_surfaces" / f"paper_face_{x}.h5" for x in "ab")


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_formats_lists_every_reader():
    listed = run("formats")
    assert listed.exit_code == 0, listed.output
    for name in ("hdf5", "npy", "x3p", "vendor"):
        assert name in listed.stdout


def test_init_config_writes_the_defaults_once(tmp_path):
    path = tmp_path / "mine.toml"
    assert run("init-config", path).exit_code == 0
    assert capslip.load_settings(path) == capslip.Settings()
    again = run("init-config", path)
    assert again.exit_code == 2
    assert "exists already" in again.stderr


def test_reproduce_writes_table_1(tmp_path):
    assert run("reproduce", "-o", tmp_path / "r", "-q").exit_code == 0
    table = json.loads((tmp_path / "r" / "reproduce.json").read_text())["table1"]
    assert len(table) == 14
    for row in table:
        assert row["computed_N"] == pytest.approx(row["printed_N"], rel=1.2e-3)


def test_caps_of_both_faces_count_together(tmp_path):
    light = ("--no-figures", "--no-render", "--json", "--set", "mating.way=together")
    ran = run("analyze", FACE_A, "--mate", FACE_B, "-o", tmp_path / "both", *light)
    assert ran.exit_code == 0, ran.output
    families = json.loads(ran.stdout)["families"]
    assert (families["m"], families["n"]) == (5, 18)


def test_export_writes_jenkins_elements(tmp_path):
    light = ("--no-figures", "--no-render", "-q")
    ran = run("analyze", FACE_A, "-o", tmp_path / "a", "--export", "jenkins", *light)
    assert ran.exit_code == 0, ran.output
    lines = (tmp_path / "a" / "jenkins.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines if line[0].isdigit()]
    assert sum(float(slip_N) for _, slip_N in rows) == pytest.approx(92.0, rel=1e-6)
