"""Every number of a summary is that of its name: one in the place of another is a wrong answer."""

from dataclasses import fields, replace
from platform import platform, python_version
from types import SimpleNamespace
from zlib import crc32

import numpy as np
import pytest

import capslip
from capslip import summary
from capslip.caps.families import Family
from capslip.problems import Effect, Problem
from capslip.provenance import code_sha256
from capslip.settings import Settings, load_settings
from capslip.structure.answer import Answer
from capslip.structure.response import Damping


class Of:
    """Whatever is asked of it is a number that nothing else has, but for what is given."""

    def __init__(self, **given):
        self.__dict__ |= given

    def __getattr__(self, name):
        return 1e-12 * crc32(f"{id(self)} {name}".encode())

    def __len__(self):
        return 3


def curve():
    return SimpleNamespace(stiffness_N_per_m=lambda approach_m: 3.0 * approach_m)


def analysis(**given):
    known = {
        "contact": Of(row_family=np.array(["G", "P"]), eccentricity_m=(3e-3, 4e-3)),
        "joint": Of(is_even=True, load_N=[7.0], weight=np.array([5.0])),
        "slip": Of(curve=curve(), approach_m=2.0, limits_m=np.array([8.0, 9.0])),
        "hills": Of(rejected={}),
        "caps": Of(usable=np.array([True, True, False])),
        "level": None,
        "settings": load_settings(overrides=("slip.direction_rad=0.25", "structure.joints=3")),
    }
    return SimpleNamespace(**(known | given))


def same(table, of, names, **others):
    """Assert that keys of a table are attributes of their names, or of those given."""
    for key, name in (dict(zip(names.split(), names.split(), strict=True)) | others).items():
        assert table[key] == getattr(of, name), key


def test_the_contact():
    of = analysis()
    found = summary.contact_table(of)
    same(found, of.contact, "model approach_m approach_without_bulk_m contacts max_pressure_Pa")
    same(found, of.contact, "hardness_Pa bulk")
    same(found, of.contact, "first_loading_approach_m first_loading_approach_without_bulk_m")
    same(found, of.joint, "preload_N nominal_pressure_Pa coverage scan_area_m2 scan_load_N")
    same(found, of.joint, "", joint_area_m2="area_m2")
    assert found["contact_area_m2"] == 5.0 * of.contact.contact_area_m2
    assert found["yielded_area_m2"] == 5.0 * of.contact.yielded_area_m2
    assert (found["pressure_classes"], found["stiffness_N_per_m"]) == (1, 6.0)


def test_how_the_face_lies():
    of = analysis(surface=SimpleNamespace(side_m=(0.02, 0.03)))
    of.contact.tilt_rad = (1e-6, -2e-6)
    found = summary.alignment_table(of)
    same(found, of.contact, "load_point_m eccentricity_m")
    assert found["tilt_rad"].tolist() == [1e-6, -2e-6]
    assert found["resultant_off_load_point_m"] == pytest.approx(5e-3)
    assert found["tilt_across_face_m"] == pytest.approx(3e-8 + 4e-8)


def test_the_slip():
    of = analysis()
    of.contact.lay = Of()
    found = summary.slip_table(of)
    same(found, of.slip, "kappa total_slip_force_N total_slip_displacement_m")
    same(found, of.slip, "tangential_stiffness_N_per_m")
    same(found, of.contact.lay, "kappa_range", softest_direction_rad="softest_rad")
    assert (found["limit_G_m"], found["limit_P_m"]) == (8.0, 9.0)
    assert (found["friction_coefficient"], found["direction_rad"]) == (0.2, 0.25)


def test_the_damping():
    rows = "amplitude_m loss_factor damping_ratio frequency_ratio"
    given = {name: np.array([0.01 * i, 0.02 * i]) for i, name in enumerate(rows.split(), 1)}
    of = analysis(damping=Of(**given, peak_loss_factor=0.11, first_peak_loss_factor=0.12))
    found = summary.damping_table(of)
    for name in rows.split():
        assert found[name].tolist() == given[name].tolist(), name
    same(found, of.damping, "peak_loss_factor amplitude_at_peak_m first_peak_loss_factor")
    same(found, of.damping, "amplitude_at_first_peak_m gross_slip_amplitude_m")
    same(found, of.damping, "modal_stiffness_N_per_m joint_stiffness_N_per_m")
    assert found["joints"] == 3
    assert set(found) - {"structure", "joints"} <= {one.name for one in fields(Damping)} | {
        name for name in dir(Damping) if not name.startswith("_")
    }


def test_the_hills():
    of = analysis()
    found = summary.hills_table(of)
    same(found, of.hills, "cut_height_m kept_fraction largest_region_share noise_m")
    same(found, of.hills, "pruning_height_m largest_hill_share", regions="n_regions")
    same(found, of.hills, "", hills="n_hills", hills_half_pruning="n_hills_half_pruning")
    same(found, of.hills, "", hills_double_pruning="n_hills_double_pruning")
    assert (found["caps"], found["rejected"]) == (2, {"no_sphere": 1})


def test_the_families():
    one, other, third = (
        Family(*(100.0 * i + j for j, _ in enumerate(fields(Family)))) for i in (1, 2, 3)
    )
    of = Of(G=one, P=other, levels=(one, other, third))
    found = summary._families(of)
    same(found, of, "count m n h_m h_se_m count_se separation log_odds clear")
    for table, family in (
        *((found["G"], one), (found["P"], other)),
        *zip(found["levels"], of.levels, strict=True),
    ):
        same(table, family, " ".join(table))
    assert summary._families(None) == dict.fromkeys(found) | {"levels": []}


def test_the_scan(monkeypatch):
    monkeypatch.setattr(summary, "carried_waves_m", lambda *given: given)
    texts = ("conditioning.s_filter_nesting_index_m=1e-5", "conditioning.form=plane")
    settings = load_settings(overrides=(*texts, "conditioning.l_filter_nesting_index_m=2e-3"))
    iso = SimpleNamespace(to_dict=lambda with_hills: {"with_hills": with_hills})
    surface = Of(origin=Of(), shape=(3, 5), pixel_size_m=(1e-6, 2e-6), n_measured=12, size=15)
    conditioned = Of(steps=("plane", "holes"), surface=Of())
    of = analysis(surface=surface, conditioned=conditioned, settings=settings)
    of.mate, of.iso25178 = Of(), iso
    found = summary.surface_table(of)
    same(
        found, surface.origin, "path sha256 dataset height_unit lateral_unit", format="file_format"
    )
    same(found, conditioned, "sq_m sz_m")
    assert found["measurement_noise_m"] == conditioned.surface.noise_m
    same(found["mate"], of.mate, "path sha256")
    assert (found["shape"], found["pixel_size_m"]) == ([3, 5], [1e-6, 2e-6])
    assert (found["form"], found["steps"]) == ("plane", ["plane", "holes"])
    assert found["non_measured_fraction"] == pytest.approx(0.2)
    carried = (conditioned.surface, of.hills.noise_m, 1e-5, 2e-3)
    assert found["iso25178"]["carried_waves_m"] == carried
    assert found["iso25178"]["contact_diameter_m"] == of.caps.contact_diameter_m
    assert found["iso25178"]["with_hills"] == settings.run.figures


def test_one_of_several_scans():
    of = analysis(name="left", status="check", estimated_error=0.07, answer=Of(), problems=())
    of.surface, of.conditioned = Of(origin=Of()), Of()
    found = summary.scan_table(of, area_m2=4.0 * of.joint.scan_area_m2)
    same(found, of.surface.origin, "path sha256")
    same(found, of.joint, "scan_area_m2 scan_load_N")
    same(found, of.contact, "model contacts approach_m max_pressure_Pa")
    same(found["answer"], of.answer, " ".join(one.name for one in fields(Answer)))
    assert (found["name"], found["status"], found["estimated_error"]) == ("left", "check", 0.07)
    assert (found["sq_m"], found["caps"]) == (of.conditioned.sq_m, 2)
    assert found["share"] == 0.25
    of.slip = None
    assert summary.scan_table(of, 1.0)["share"] is None


def test_question_and_answer():
    names = [one.name for one in fields(Answer)]
    band = Of(interval={name: (0.1 * i, 0.2 * i) for i, name in enumerate(names)})
    of = analysis(answer=Of(), band=band)
    found = summary._answer(of)
    same(found, of.answer, " ".join(names))
    same(found, band, "interval contributions", not_in_interval="left_out")
    quarter = {"quantity": "slip_force_N", "value": 0.25 * of.slip.total_slip_force_N}
    assert found["asked"] == quarter | {"by_default": True}
    of.settings = load_settings(overrides=("answer.displacement_m=3e-8",))
    asked = {"quantity": "displacement_m", "value": 3e-8, "by_default": False}
    assert summary._answer(of)["asked"] == asked


def test_what_goes_round_the_tables(several):
    problem = Problem("spikes", "warning", "said", Effect(0.1, 0.2, 0.3))
    found = replace(several, problems=(problem,)).summary()
    for name in ("status", "verdict", "name"):
        assert found[name] == getattr(replace(several, problems=(problem,)), name)
    effect = {"tangential_stiffness": 0.1, "energy": 0.2, "loss_factor": 0.3}
    said = {"code": "spikes", "severity": "warning", "message": "said", "effect": effect}
    assert found["problems"] == [said | {"remedy": problem.remedy}]
    accuracy = {"requested": several.settings.contact.tolerance}
    accuracy |= {"estimated": several.estimated_error, "model_reason": several.contact.model_reason}
    assert found["accuracy"] == accuracy
    assert found["assumed"][0] == {
        "name": "material",
        "setting": "material.youngs_modulus_Pa",
        "value": "E 200 GPa, nu 0.3",
        "moves": "stiffness, displacements, energy, loss",
    }
    record = found["provenance"]
    assert (record["version"], record["code_sha256"]) == (capslip.__version__, code_sha256())
    assert record["settings_sha256"] == several.settings.sha256() != Settings().sha256()
    assert (record["started"], record["command"]) == (several.started, None)
    assert (record["python"], record["platform"]) == (python_version(), platform())
    assert found["schema"] == "capslip/summary/1"
