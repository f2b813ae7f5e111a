"""Repeated scans on the command line: their mean is a scan that knows its noise."""

import errno
import json
import os
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.ndimage import shift

from capslip.analysis import analyze_scans
from capslip.cli import main
from capslip.errors import UnreadableFileError
from capslip.provenance import sha256_of
from capslip.settings import load_settings
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.average import average
from capslip.surface.readers import load_surface
from capslip.surface.readers.hdf5 import write_hdf5

NOISE_M = 4e-9


def run(*arguments):
    return CliRunner().invoke(main, [str(one) for one in arguments])


def face(seed=1):
    scene = Scene(
        (90, 120), (1e-4, 1e-4), seed, waviness_rms_m=3e-7, waviness_length_m=1.5e-3, floor_m=0.0
    )
    return synthetic_surface(scene)[0]


def repeats(seed=1, n=3):
    surface, rng = face(seed), np.random.default_rng((8, seed))
    return [
        replace(surface, height_m=surface.height_m + NOISE_M * rng.standard_normal(surface.shape))
        for _ in range(n)
    ]


@pytest.fixture
def scans(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, one in zip("abc", repeats(), strict=True):
        write_hdf5(one, f"{name}.h5")
    return ["a.h5", "b.h5", "c.h5"]


def test_the_mean_is_written_with_its_noise_and_told(scans, tmp_path):
    ran = run("average", *scans)
    assert ran.exit_code == 0
    told = dict(line.split(None, 1) for line in ran.stdout.splitlines() if line[0] != " ")
    assert told["written"] == "a-mean.h5"
    mean, found = load_surface("a-mean.h5"), average(repeats())
    assert np.array_equal(mean.height_m, found.surface.height_m)
    assert mean.noise_m == found.surface.noise_m
    assert mean.noise_m == pytest.approx(NOISE_M / np.sqrt(3.0), rel=0.1)
    assert f"{1e9 * found.noise_m:.3g} nm (rms) a height of one scan" in told["noise"]
    assert f"{1e9 * found.white_m:.3g} nm from pixel to pixel" in told["noise"]
    assert f"{1e9 * mean.noise_m:.3g} nm, over the root of 3" in ran.stdout
    assert [f"{name}.h5 by" in ran.stdout for name in "abc"] == [False, True, True]
    assert "-0.00" not in ran.stdout
    assert "0.00 pixels along y, 0.00 along x" in ran.stdout
    assert not {"left", "bow"} & set(told)
    with h5py.File("a-mean.h5") as file:
        of = list(file["height"].attrs["mean_of"])
    assert of == [f"{name} (SHA-256 {sha256_of(tmp_path / name)})" for name in scans]
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a-mean.h5", *scans]


def test_what_a_mean_does_not_read_of_the_settings_is_said_in_one_line(scans):
    plain = run("average", *scans, "-q", "-o", "plain.h5")
    read = run("average", *scans, "--set", "reading.invert=false", "-q", "-o", "read.h5")
    assert (plain.exit_code, plain.stderr, read.stderr) == (0, "", "")
    idle = "instrument.noise_m=1e-9", "contact.preload_N=50", "run.figures=false"
    given = [word for one in idle for word in ("--set", one)]
    ran = run("average", *scans, *given, "-q", "-o", "given.h5")
    assert (ran.exit_code, ran.stderr.count("\n")) == (0, 1)
    names = "instrument.noise_m, contact.preload_N are not used"
    assert ran.stderr.startswith(f"warning: settings_ignored: {names}")
    assert load_surface("given.h5").noise_m == load_surface("plain.h5").noise_m


def test_a_mean_that_finds_no_room_is_one_line_and_no_file(scans, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    ran = run("average", *scans, "-q")
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert ran.stderr == (
        "error: a-mean.h5: cannot be written (No space left on device); nothing was written; make "
        f"room on the disk of {tmp_path}, or choose another folder\n"
    )
    assert sorted(one.name for one in tmp_path.iterdir()) == scans


def test_averages_that_share_a_scan_are_refused_and_others_are_as_good_as_they_say(scans):
    """Of ab and bc the noise of b does not go down: 0.61 of that of one scan, not 0.35."""
    write_hdf5(repeats(n=4)[3], "d.h5")
    for pair in ("ab", "bc", "cd"):
        assert run("average", *(f"{name}.h5" for name in pair), "-o", f"{pair}.h5").exit_code == 0
    for given, said in (
        (("ab", "bc"), "error: ab and bc: b.h5 in both"),
        (("ab", "a"), "error: ab and a: a.h5 in both"),
        (("c", "d", "bc"), "error: c and bc: c.h5 in both"),
    ):
        ran = run("average", *(f"{name}.h5" for name in given), "-o", "no.h5")
        assert (ran.exit_code, ran.stdout) == (2, "")
        (line,) = (one for one in ran.stderr.splitlines() if one.startswith("error"))
        assert line.startswith(said)
        assert line.endswith("give the scans themselves")
    assert not Path("no.h5").exists()
    assert run("average", "ab.h5", "cd.h5", "-o", "abcd.h5").exit_code == 0
    whole, once = load_surface("abcd.h5"), average([load_surface(f"{one}.h5") for one in "abcd"])
    assert whole.noise_m == pytest.approx(once.surface.noise_m, rel=0.1)
    of = [line.split(" ")[0] for line in whole.origin.mean_of]
    assert of == ["ab.h5", "a.h5", "b.h5", "cd.h5", "c.h5", "d.h5"]
    ran = run("average", "abcd.h5", "bc.h5", "-o", "no.h5")
    assert "error: abcd and bc: b.h5, c.h5 in both" in ran.stderr


def test_a_damaged_list_of_scans_does_not_hang_the_library(scans):
    assert run("average", *scans).exit_code == 0
    whole = Path("a-mean.h5").read_bytes()
    at = whole.index(b"mean_of\0")
    for which in range(3):  # the length of each of its strings
        length = len(load_surface("a-mean.h5").origin.mean_of[which]).to_bytes(4, "little")
        place = at
        for _ in range(1 + which):
            place = whole.index(length, place + 1)
        broken = bytearray(whole)
        broken[place : place + 4] = b"\xff\xff\xff\x7f"
        Path("broken.h5").write_bytes(broken)
        with pytest.raises(UnreadableFileError, match="damaged HDF5 file at offset"):
            load_surface("broken.h5")


@pytest.mark.parametrize("odd", [3.0, "one", np.array([[1, 2]]), np.array([b"x", b"y"])])
def test_a_list_of_scans_that_is_none_of_ours_is_no_matter(scans, odd):
    with h5py.File("a.h5", "r+") as file:
        file["height"].attrs["mean_of"] = odd
    assert load_surface("a.h5").origin.mean_of == ()


def test_what_splines_take_of_the_noise_is_told(scans):
    assert "splines" not in run("average", *scans).stdout
    first, second, _ = repeats()
    moved_m = shift(face().height_m, (0.5, 0.4), order=5, mode="nearest")
    second = replace(second, height_m=second.height_m - face().height_m + moved_m)
    for name, one in (("a", first), ("b", second)):
        write_hdf5(one, f"{name}.h5")
    ran = run("average", "a.h5", "b.h5", "-o", "moved.h5")
    found = average([load_surface("a.h5"), load_surface("b.h5")])
    assert found.surface.noise_m < 0.97 * found.noise_m / np.sqrt(2.0)
    assert "over the root of 2, less what splines took where scans lie a fraction" in ran.stdout


def test_a_mean_names_scans_of_odd_bytes(scans):
    odd = "b\udce9\x1b.h5"  # a name in Latin-1, which a file of another system may have
    Path("b.h5").rename(odd)
    assert run("average", "a.h5", odd, "-o", "mean.h5").exit_code == 0
    with h5py.File("mean.h5") as file:
        assert file["height"].attrs["mean_of"][1].startswith(r"b\udce9\x1b.h5 (SHA-256 ")
    assert load_surface("mean.h5").noise_m > 0.0


def test_spikes_and_bows_are_told_where_there_are_any(scans):
    surface = load_surface("b.h5")
    y, x = np.ix_(*(np.linspace(-1.0, 1.0, n) for n in surface.shape))
    bowed_m = surface.height_m + 1e-7 * (x * x + y)
    bowed_m[40, 50] += 1e-6
    write_hdf5(replace(surface, height_m=bowed_m), "b.h5")
    ran = run("average", *scans, "-o", "mean.h5")
    assert "left out   1 heights that only one scan has" in ran.stdout
    assert "bow        forms differ by" in ran.stdout
    assert run("average", *scans, "-o", "quiet.h5", "-q").output == ""
    assert np.array_equal(*(load_surface(f"{one}.h5").height_m for one in ("mean", "quiet")))


def test_points_that_not_all_scans_have_are_told(scans):
    assert "fewer" not in run("average", *scans).stdout
    holed_m = np.array(load_surface("b.h5").height_m)
    holed_m[::2] = np.nan
    write_hdf5(replace(load_surface("b.h5"), height_m=holed_m), "b.h5")
    ran = run("average", *scans, "-o", "mean.h5")
    mean_m, found = load_surface("mean.h5").noise_m, average([load_surface(one) for one in scans])
    assert found.surface.noise_m == mean_m > 1.05 * found.noise_m / np.sqrt(3.0)
    assert (
        f"{1e9 * mean_m:.3g} nm, over the root of {found.scans_a_point:.3g}; "
        "5400 of 10800 points are in fewer than 3 scans"
    ) in " ".join(ran.stdout.split())
    assert "splines" not in ran.stdout


def test_nothing_is_overwritten_or_left_half(scans, tmp_path):
    before = (tmp_path / "b.h5").read_bytes()
    for arguments, said in (
        ((*scans, "-o", "b.h5"), "b.h5: exists already; nothing was written"),
        ((*scans, "-o", "mean.npy"), "mean.npy: got .npy; expected .h5"),
        ((*scans, "-o", "none/mean.h5"), "none/mean.h5: no such folder"),
        (("a.h5",), "scans: got 1; expected two of one place, or more"),
        (("a.h5", "a.h5"), "a and a: hold the same heights"),
    ):
        ran = run("average", *arguments)
        assert (ran.exit_code, ran.stdout) == (2, "")
        assert said in ran.stderr
    assert run("average", "a.h5", "none.h5").exit_code == 3
    assert (tmp_path / "b.h5").read_bytes() == before
    assert sorted(one.name for one in tmp_path.iterdir()) == scans


def test_units_that_the_files_lack_are_given_once_for_all(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, one in zip("ab", repeats(n=2), strict=True):
        np.save(f"{name}.npy", 1e9 * one.height_m)
    given = ("--unit", "nm", "--pixel-size", "0.1", "0.1", "--lateral-unit", "mm")
    assert run("average", "a.npy", "b.npy", *given).exit_code == 0
    mean = load_surface("a-mean.h5")
    assert mean.noise_m == pytest.approx(NOISE_M / np.sqrt(2.0), rel=0.1)
    assert mean.pixel_size_m == pytest.approx((1e-4, 1e-4))


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
def test_an_analysis_of_the_mean_knows_its_noise_and_takes_it_off(scans):
    assert run("average", *scans).exit_code == 0
    options = ("--preload", 50, "--no-figures", "--no-render", "--no-meshes", "--json")
    found = json.loads(run("analyze", "a-mean.h5", *options, "-o", "out").stdout)
    assert found["surface"]["measurement_noise_m"] == load_surface("a-mean.h5").noise_m
    codes = {one["code"] for one in found["problems"]}
    assert "noise_taken_off" in codes
    assert "reader_note" not in codes
    assert "noise" not in {one["name"] for one in found["assumed"]}
    other = json.loads(run("analyze", "a.h5", *options, "-o", "one").stdout)
    assert other["surface"]["measurement_noise_m"] is None
    assert "noise" in {one["name"] for one in other["assumed"]}
    again = load_surface("out/result.h5", dataset="surface/height_m")
    assert again.noise_m == found["surface"]["measurement_noise_m"]


@pytest.mark.long
@pytest.mark.usefixtures("here", "fewer_points")
def test_a_batch_of_means_is_done_once(scans, tmp_path):
    assert run("average", *scans).exit_code == 0
    options = ("--preload", 50, "--no-figures", "--no-render", "--no-meshes", "--workers", 1)
    written = []
    for _ in range(2):
        assert run("batch", "a-mean.h5", "-o", "all", *options).exit_code == 0
        written.append((tmp_path / "all/scans/a-mean/summary.json").stat().st_mtime_ns)
    assert written[0] == written[1]


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
def test_a_joint_of_means_knows_its_noise_where_each_does():
    means = [average(repeats(seed)).surface for seed in (1, 2)]
    settings = load_settings(overrides=("contact.nominal_pressure_Pa=5e5", "joint.area_m2=1e-3"))
    for surfaces, known in ((means, True), ([means[0], replace(means[1], noise_m=None)], False)):
        found = analyze_scans(surfaces, settings)
        assert found.settings == settings
        assert found.noise_known is known
        assert ("noise" in {one["name"] for one in found.summary()["assumed"]}) is not known
        assert ("noise of the map that pixels share" in found.band.left_out) is not known
