"""The numbers of a result on disk, without what is drawn beside them."""

import csv
import json
import tomllib

import h5py
import numpy as np
import output_cases
import pytest

from capslip.analysis import analyze
from capslip.output.tables import write_result, write_summary
from capslip.settings import load_settings
from scenes import caps_map


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("result")
    analysis = output_cases.several()
    write_result(analysis, folder)
    return analysis, folder


def test_curves_run_from_a_thousandth_to_all_of_preload_and_force(written):
    analysis, folder = written
    with h5py.File(folder / "result.h5") as file:
        load_N, force_N = file["normal/load_N"][:], file["slip/force_N"][:]
        assert (load_N[0], load_N[1], load_N[-1]) == (0.0, pytest.approx(0.15), pytest.approx(150))
        assert len(load_N) == 81
        assert np.diff(np.log(load_N[1:])) == pytest.approx(np.log(1e3) / 79)
        total_N = analysis.slip.total_slip_force_N
        assert len(force_N) == 96
        assert (force_N[0], force_N[-1]) == (pytest.approx(1e-3 * total_N), pytest.approx(total_N))
        np.testing.assert_allclose(
            file["normal/approach_m"][:], analysis.contact.normal.approach_m(load_N)
        )
        np.testing.assert_allclose(
            file["slip/energy_J"][:], analysis.slip.energy_at_force_J(force_N), rtol=1e-12
        )


def test_maps_keep_their_values_and_what_packs_well_is_packed(written):
    analysis, folder = written
    with h5py.File(folder / "result.h5") as file:
        for name, values, packing in (
            ("surface/height_m", analysis.conditioned.surface.height_m.astype(np.float32), None),
            ("hills/labels", analysis.hills.label, "gzip"),
        ):
            np.testing.assert_array_equal(file[name][:], values)
            assert file[name].compression == packing
        assert file["hills/labels"].shuffle
        assert file["hills/labels"].compression_opts == 1
        height = file["surface/height_m"].attrs
        assert tuple(height["pixel_size_m"]) == tuple(height["pixel_size"]) == (1e-4, 1e-4)
        assert file["caps/family"].asstr()[:].tolist() == analysis.caps.family.tolist()


def test_numbers_read_back_as_they_were(written):
    analysis, folder = written
    with (folder / "caps.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["radius_m"]) for row in rows] == analysis.caps.radius_m.tolist()
    assert [row["family"] for row in rows] == analysis.caps.family.tolist()
    assert {row["contact_radius_m"] == "" for row in rows} == {
        bool(lost) for lost in np.isnan(analysis.caps.contact_radius_m)
    }
    settings = tomllib.loads((folder / "settings.toml").read_text("utf-8"))
    assert settings == json.loads(json.dumps(analysis.settings.to_dict()))


def test_a_model_that_solves_each_load_is_asked_for_those_it_has(tmp_path):
    settings = load_settings(
        overrides=(
            "contact.model=boundary_elements",
            "contact.preload_N=60",
            "conditioning.form=none",
        )
    )
    face = caps_map([(5e-3, 5e-3, 5.0, 0.0)], (50, 60), (2e-4, 2e-4))
    analysis = analyze(face, settings)
    write_result(analysis, tmp_path)
    with h5py.File(tmp_path / "result.h5") as file:
        load_N = file["normal/load_N"][:]
    contact = analysis.contact
    np.testing.assert_array_equal(load_N, contact.rung.solved_loads_N(contact.normal, 60.0))


def test_a_result_without_contact_has_its_caps_and_no_curve(tmp_path):
    write_result(output_cases.none(), tmp_path)
    with h5py.File(tmp_path / "result.h5") as file:
        assert set(file) == {"surface", "hills", "caps"}
        assert file["caps/radius_m"].shape == (0,)


def test_the_summary_is_text_that_reads_back(tmp_path):
    write_summary({"unit": "µm", "value": 0.1, "none": None}, tmp_path)
    text = (tmp_path / "summary.json").read_text(encoding="utf-8")
    assert text == '{\n "unit": "µm",\n "value": 0.1,\n "none": null\n}\n'
    assert json.loads(text)["value"] == 0.1
    with pytest.raises(ValueError, match="JSON"):
        write_summary({"value": float("nan")}, tmp_path)
