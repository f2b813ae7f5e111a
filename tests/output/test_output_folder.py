"""Writing: whole or not at all, the same numbers in every file, and no number lost to a picture."""

import csv
import errno
import json
import os
import re
from dataclasses import replace
from types import SimpleNamespace

import h5py
import msgspec
import numpy as np
import output_cases
import pytest

import capslip
from capslip.caps.table import UNITS
from capslip.contact.slip import SlipCurve
from capslip.errors import OutputError, SettingsError
from capslip.output import figures, mesh, scene, staging, tables
from capslip.output.export import export_named, inexact
from capslip.problems import Problem
from capslip.structure.jenkins import jenkins
from capslip.units import percent
from check_result import defects

DATASETS = {  # every dataset beside the caps, with its unit
    "surface/thumbnail_png": "",
    "surface/height_m": "m",
    "hills/labels": "",
    "normal/approach_m": "m",
    "normal/load_N": "N",
    **{f"zones/{name}": "" for name in ("share", "cap", "pixel", "pixel_contact", "pixel_reach")},
    **{f"zones/{name}": "N" for name in ("load_N", "contact_load_N")},
    **{f"zones/{name}": "m" for name in ("withdrawal_m", "closing_m", "radius_m")},
    "zones/pixel_area_m2": "m^2",
    "slip/force_N": "N",
    "slip/displacement_m": "m",
    "slip/energy_J": "J",
    "damping/amplitude_m": "m",
    "damping/force_N": "N",
    "damping/loss_factor": "1",
    "damping/damping_ratio": "1",
    "damping/frequency_ratio": "1",
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    analysis, folder = output_cases.several(), tmp_path_factory.mktemp("written") / "result"
    told = []
    summary = capslip.write(
        analysis,
        folder,
        command="capslip by hand",
        timings_s={"read": 2.0},
        figures=False,
        render=False,
        export="jenkins",
        progress=told.append,
        missing=lambda text, error: pytest.fail(text),
    )
    assert told == ["writing the report"]
    return analysis, folder, summary


@pytest.mark.long
def test_each_stage_of_writing_has_its_own_time(tmp_path, monkeypatch):
    """What another program asked for is no time of meshes."""
    takes_s, now_s = {"export": 19.0, "meshes": 2.0}, [0.0]

    def slow(stage):
        def made(*given):
            now_s[0] += takes_s[stage]

        return made

    clock = SimpleNamespace(perf_counter=lambda: now_s[0])
    export = replace(export_named("jenkins"), write=slow("export"))
    monkeypatch.setattr("capslip.output.folder.time", clock)
    monkeypatch.setattr("capslip.output.folder.export_named", lambda name: export)
    monkeypatch.setattr("capslip.output.mesh.write_meshes", slow("meshes"))
    analysis = output_cases.one()
    run = msgspec.structs.replace(analysis.settings.run, meshes=True)
    analysis = replace(analysis, settings=msgspec.structs.replace(analysis.settings, run=run))
    given = {"figures": False, "render": False, "page": False, "export": "jenkins"}
    times_s = capslip.write(analysis, tmp_path / "result", **given)["timings_s"]
    assert {stage: times_s[stage] for stage in takes_s} == takes_s


def test_the_summary_returned_is_the_one_on_disk(written):
    analysis, folder, summary = written
    assert json.loads((folder / "summary.json").read_text()) == summary
    run = msgspec.structs.replace(analysis.settings.run, figures=False, render=False)
    as_written = replace(analysis, settings=msgspec.structs.replace(analysis.settings, run=run))
    for key, one in as_written.summary().items():
        if key not in ("timings_s", "provenance"):
            assert summary[key] == one
    assert summary["provenance"]["command"] == "capslip by hand"
    times_s = summary["timings_s"]
    assert times_s["read"] == 2.0
    assert {"tables", "export", "report", "hills", "caps"} <= set(times_s)
    rest_s = [time_s for stage, time_s in times_s.items() if stage != "total"]
    assert times_s["total"] == pytest.approx(sum(rest_s), rel=1e-9)


def test_the_folder_is_whole(written):
    _, folder, _ = written
    assert defects(folder) == []
    assert (folder / "jenkins.csv").is_file()
    assert list((folder / "figures").iterdir()) == []
    assert [entry.name for entry in folder.parent.iterdir()] == ["result"]


def test_the_settings_say_what_was_drawn(written):
    analysis, folder, _ = written
    settings = capslip.load_settings(folder / "settings.toml")
    assert not settings.run.figures
    assert not settings.run.render
    assert settings.sha256() == analysis.settings.sha256()


def test_the_table_of_caps_is_that_of_the_analysis(written):
    analysis, folder, _ = written
    with (folder / "caps.csv").open() as file:
        rows = list(csv.DictReader(file))
    columns = analysis.caps.columns()
    assert list(rows[0]) == list(columns) == list(UNITS)
    with h5py.File(folder / "result.h5") as file:
        for name, column in columns.items():
            assert file[f"caps/{name}"].attrs["unit"] == UNITS[name]
            cells = [row[name] for row in rows]
            if column.dtype.kind == "f":
                np.testing.assert_array_equal(file[f"caps/{name}"][:], column)
                np.testing.assert_array_equal([float(c or "nan") for c in cells], column)
            else:
                assert cells == [str(one) for one in column]


def test_an_absent_number_is_an_empty_cell(tmp_path):
    analysis = output_cases.several()
    load_N = analysis.caps.load_N.copy()
    load_N[1] = np.nan
    analysis = replace(analysis, caps=analysis.caps.with_columns(load_N=load_N))
    tables.write_result(analysis, tmp_path)
    with (tmp_path / "caps.csv").open() as file:
        cells = [row["load_N"] for row in csv.DictReader(file)]
    assert [cell == "" for cell in cells] == [i == 1 for i in range(len(load_N))]


def test_every_dataset_has_its_unit_and_its_numbers(written):
    analysis, folder, _ = written
    slip, damping, surface = analysis.slip, analysis.damping, analysis.conditioned.surface
    with h5py.File(folder / "result.h5") as file:
        units = {}
        file.visititems(
            lambda name, item: (
                units.update({name: item.attrs["unit"]}) if isinstance(item, h5py.Dataset) else None
            )
        )
        assert {name: unit for name, unit in units.items() if "caps/" not in name} == DATASETS
        height = file["surface/height_m"]
        assert tuple(height.attrs["pixel_size_m"]) == surface.pixel_size_m
        np.testing.assert_allclose(height[:], surface.height_m, rtol=1e-6)
        np.testing.assert_array_equal(file["hills/labels"][:], analysis.hills.label)
        load_N = file["normal/load_N"][:]
        assert load_N[0] == 0.0
        assert load_N[-1] == pytest.approx(analysis.contact.preload_N)
        approach_m = analysis.contact.normal.approach_m(load_N)
        np.testing.assert_allclose(file["normal/approach_m"][:], approach_m)
        force_N = file["slip/force_N"][:]
        assert len(force_N) >= 64
        assert force_N[-1] == pytest.approx(slip.total_slip_force_N)
        np.testing.assert_allclose(file["slip/displacement_m"][:], slip.displacement_m(force_N))
        np.testing.assert_allclose(file["slip/energy_J"][:], slip.energy_at_force_J(force_N))
        for name in file["damping"]:
            np.testing.assert_array_equal(file[f"damping/{name}"][:], getattr(damping, name))


def test_a_native_file_of_the_result_reads_back_as_the_face(written):
    analysis, folder, _ = written
    back = capslip.load_surface(folder / "result.h5", dataset="/surface/height_m")
    face = analysis.conditioned.surface
    assert back.pixel_size_m == pytest.approx(face.pixel_size_m)
    np.testing.assert_allclose(back.height_m, face.height_m, rtol=1e-6)


def test_every_part_that_fails_is_told_once_and_the_report_names_it(tmp_path, monkeypatch):
    def fail(*_):
        raise ValueError("torn")

    monkeypatch.setattr(mesh, "write_meshes", fail)
    told = []
    summary = capslip.write(
        output_cases.none(),
        tmp_path / "a",
        figures=False,
        render=False,
        export="jenkins",
        missing=lambda text, error: told.append((text, type(error))),
    )
    texts = [p["message"] for p in summary["problems"] if p["code"] == "output_missing"]
    assert [text for text, _ in told] == texts
    assert texts[0].startswith("jenkins.csv could not be made: it needs a slip curve")
    assert texts[1] == "surface.vtu and caps.vtu could not be made: ValueError: torn"
    assert [kind.__name__ for _, kind in told] == ["ContactError", "ValueError"]
    assert "ValueError: torn" in (tmp_path / "a" / "report.html").read_text()


def rendered(wait, folder, monkeypatch):
    """Write a result whose drawing process ends so; return what is told, and the summary."""
    told = []
    monkeypatch.setattr(scene, "start_render", lambda *_: SimpleNamespace(wait=wait))
    summary = capslip.write(
        output_cases.none(),
        folder,
        figures=False,
        render=True,
        missing=lambda text, error: told.append((text, error)),
    )
    return told, summary


def test_no_display_is_told_but_no_problem(tmp_path, monkeypatch):
    told, summary = rendered(lambda: "no OpenGL here", tmp_path / "a", monkeypatch)
    assert told == [("no render: no OpenGL here", None)]
    assert "output_missing" not in [p["code"] for p in summary["problems"]]
    assert "no OpenGL here" in (tmp_path / "a" / "report.html").read_text()


def test_a_picture_for_which_the_disk_has_no_room_is_a_part_that_is_missing(tmp_path, monkeypatch):
    told, summary = rendered(no_room, tmp_path / "a", monkeypatch)
    text = "scene.png could not be made: No space left on device; make room on the disk"
    assert [(said, error.errno) for said, error in told] == [(text, errno.ENOSPC)]
    assert [p["message"] for p in summary["problems"] if p["code"] == "output_missing"] == [text]
    page = (tmp_path / "a" / "report.html").read_text("utf-8")
    assert text in page
    assert "OpenGL" not in page


def test_an_interrupt_ends_the_renderer_and_leaves_nothing(tmp_path, monkeypatch):
    ended = []

    class Slow:
        def wait(self):
            raise KeyboardInterrupt

        def stop(self):
            ended.append(True)

    monkeypatch.setattr(scene, "start_render", lambda *_: Slow())
    with pytest.raises(KeyboardInterrupt):
        capslip.write(output_cases.none(), tmp_path / "a", figures=False, render=True)
    assert ended == [True]
    assert list(tmp_path.iterdir()) == []


def test_a_failing_number_leaves_no_folder(tmp_path, monkeypatch):
    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(tables, "write_summary", fail)
    with pytest.raises(OSError, match="disk full"):
        capslip.write(output_cases.none(), tmp_path / "a", figures=False, render=False)
    assert list(tmp_path.iterdir()) == []


NUMBERS = {"result.h5", "caps.csv", "settings.toml", "summary.json"}
LIGHT = {"figures": False, "render": False}


def no_room():
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def disk_of(size, monkeypatch):
    """Let the last of the numbers find a disk of that size."""
    write_summary = tables.write_summary

    def on_disk(summary, folder):
        write_summary(summary, folder)
        if sum(one.stat().st_size for one in folder.rglob("*") if one.is_file()) > size:
            no_room()

    monkeypatch.setattr(tables, "write_summary", on_disk)


@pytest.mark.parametrize("export", [None, "jenkins"])
def test_on_a_full_disk_what_is_no_number_makes_room(written, tmp_path, monkeypatch, export):
    _, folder, whole = written
    room = sum((folder / name).stat().st_size for name in NUMBERS)
    disk_of(room + 5000, monkeypatch)
    told, out = [], tmp_path / "a"
    (out / "figures").mkdir(parents=True)
    summary = capslip.write(
        output_cases.several(),
        out,
        **LIGHT,
        export=export,
        missing=lambda text, error: told.append((text, error.errno)),
    )
    assert {one.name for one in out.iterdir() if not one.is_dir()} == NUMBERS
    assert not list((out / "figures").iterdir())  # which was there before
    assert json.loads((out / "summary.json").read_text()) == summary
    assert set(summary["outputs"]) == NUMBERS
    assert summary["damping"] == whole["damping"]
    (missing,) = (p for p in summary["problems"] if p["code"] == "output_missing")
    gone = "caps.vtu and jenkins.csv and report.html" if export else "caps.vtu and report.html"
    text = f"{gone} and surface.vtu gave way to the numbers: the disk is full; make room on it"
    assert missing["message"] == text
    assert told == [(text, errno.ENOSPC)]


def test_room_is_left_for_what_is_noted_beside_a_result(tmp_path, monkeypatch):
    monkeypatch.setattr(staging, "check_room", lambda work: no_room())
    summary = capslip.write(output_cases.none(), tmp_path / "a", **LIGHT)
    assert set(summary["outputs"]) == NUMBERS
    assert {one.name for one in (tmp_path / "a").iterdir()} == NUMBERS


def test_a_disk_without_room_for_the_numbers_keeps_the_earlier_result(tmp_path, monkeypatch):
    capslip.write(output_cases.none(), tmp_path / "a", **LIGHT)
    before = {one: one.read_bytes() for one in tmp_path.rglob("*") if one.is_file()}
    disk_of(1000, monkeypatch)
    for name in ("a", "new"):
        with pytest.raises(OutputError) as told:
            capslip.write(output_cases.none(), tmp_path / name, **LIGHT)
        assert str(told.value) == (
            f"output folder {tmp_path / name}: No space left on device; nothing was written; make "
            "room on its disk, or choose another with --out"
        )
    assert {one: one.read_bytes() for one in tmp_path.rglob("*") if one.is_file()} == before
    assert [one.name for one in tmp_path.iterdir()] == ["a"]


def test_an_error_that_is_not_of_the_disk_makes_nothing_give_way(tmp_path, monkeypatch):
    tries = []

    def fail(*_):
        tries.append(1)
        raise OSError(errno.EIO, "torn")

    monkeypatch.setattr(tables, "write_summary", fail)
    with pytest.raises(OSError, match="torn"):
        capslip.write(output_cases.none(), tmp_path / "a", **LIGHT)
    assert tries == [1]


def test_the_scan_itself_is_never_replaced(tmp_path):
    analysis = output_cases.none()
    light = {"figures": False, "render": False}
    capslip.write(analysis, tmp_path / "a", **light)
    origin = replace(analysis.surface.origin, path=str(tmp_path / "a" / "result.h5"))
    surface = replace(analysis.surface, origin=origin)
    with pytest.raises(OutputError, match="would be replaced"):
        capslip.write(replace(analysis, surface=surface), tmp_path / "a", **light)
    capslip.write(replace(analysis, surface=surface), tmp_path / "b", **light)


class Stepped(SlipCurve):
    """Loses a third more below two tenths of the way to total slip: no sliders do."""

    def energy_J(self, displacement_m):
        small = np.asarray(displacement_m) < 0.2 * self.total_slip_displacement_m
        return super().energy_J(displacement_m) * (1.0 + small / 3.0)


@pytest.mark.parametrize(("tolerance", "severity"), [(0.05, "warning"), (0.5, "info")])
def test_an_export_that_is_less_good_than_the_result_says_so(tolerance, severity, tmp_path):
    analysis, told = output_cases.several(), []
    slip = analysis.slip
    given = slip.curve, slip.preload_N, slip.approach_m, slip.friction_coefficient, slip.kappa
    contact = msgspec.structs.replace(analysis.settings.contact, tolerance=tolerance)
    settings = msgspec.structs.replace(analysis.settings, contact=contact)
    summary = capslip.write(
        replace(analysis, slip=Stepped(*given), settings=settings),
        tmp_path / "a",
        figures=False,
        render=False,
        page=False,
        export="jenkins",
        missing=lambda text, error: told.append(text),
    )
    (found,) = (p for p in summary["problems"] if p["code"] == "export_inexact")
    assert found["severity"] == severity
    text = (
        r"jenkins\.csv: its sliders lose the energy of a cycle within 1 % from (\d+) % of mu N on; "
    )
    text += r"from a tenth of mu N on they may be off by (\d+) %"
    share, error = map(float, re.fullmatch(text, found["message"]).groups())
    at_border = slip.force_N(0.2 * slip.total_slip_displacement_m) / slip.total_slip_force_N
    assert share / 100 == pytest.approx(at_border, rel=0.2)
    assert 5 < error < 34
    assert told == ([found["message"]] if severity == "warning" else [])


def test_the_worst_of_several_sliders_is_said():
    slip = output_cases.several().slip
    good = jenkins(slip, 0.01)
    bad = replace(good, checked_error=np.where(good.checked_m < good.checked_m[50], 0.3, 0.001))
    assert inexact("a.csv", [good, good], 0.01, 0.05) == ()
    (small,) = inexact("a.csv", [good, bad, good], 0.01, 0.05)
    share = float(good.force_N(good.checked_m[50]) / good.slip_force_N.sum())
    assert share < 0.1  # less than a joint is asked for
    assert small.severity == "info"
    assert f"within 1 % from {percent(share)} of mu N on" in small.message


def test_sliders_whose_error_reads_as_the_one_that_was_asked_for_say_nothing():
    """2.04 % at the last displacement read "within 2 % from 100 % of mu N on; off by 2 %"."""
    good = jenkins(output_cases.several().slip, 0.02)
    at_end = np.where(good.checked_m == good.checked_m[-1], 1.0, 0.0)
    for error, said in ((0.0204, False), (0.0206, True)):
        off = replace(good, checked_error=error * at_end)
        found = inexact("a.csv", [off], 0.02, 0.05)
        assert bool(found) == said
    assert "off by 2.1 %" in found[0].message
    small = replace(good, checked_error=np.where(good.checked_m == good.checked_m[0], 0.3, 0.0204))
    (found,) = inexact("a.csv", [small], 0.02, 0.05)
    assert found.message.endswith(" of mu N on")  # from a tenth on they are as good as asked


def test_an_unknown_export_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(SettingsError, match="jenkins"):
        capslip.write(output_cases.none(), tmp_path / "a", export="abaqus")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_analysis_is_written(tmp_path):
    problem = Problem("contact_failed", "error", "too much")
    analysis = replace(output_cases.none(), problems=(problem,))
    summary = capslip.write(analysis, tmp_path / "a", figures=False, render=False)
    assert summary["status"] == "failed"
    assert defects(tmp_path / "a") == ["status failed"]


@pytest.mark.long
@pytest.mark.parametrize("name", ["height_map", "hills_and_caps", "loss_factor"])
def test_a_figure_that_fails_here_or_in_the_copy_is_told_once(name, tmp_path, monkeypatch):
    def fail(*_):
        raise ValueError("torn")

    monkeypatch.delitem(figures.FIGURES, "sensitivity")  # takes as long as all others
    monkeypatch.setitem(figures.FIGURES, name, replace(figures.FIGURES[name], draw=fail))
    told = []
    summary = capslip.write(
        output_cases.several(),
        tmp_path / "a",
        render=False,
        missing=lambda text, error: told.append((text, type(error))),
    )
    text = f"{name}.png could not be made: ValueError: torn"
    assert told == [(text, ValueError)]
    assert [p["message"] for p in summary["problems"] if p["code"] == "output_missing"] == [text]
    drawn = {path.stem for path in (tmp_path / "a" / "figures").iterdir()}
    assert drawn == set(figures.FIGURES) - {name}
    page = (tmp_path / "a" / "report.html").read_text("utf-8")
    assert text in page
