"""The ladder: what is a rung is one file, and no other module knows it by name."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from contact_cases import E_STAR_PA, scene_of, table

import capslip
from capslip import registry
from capslip.contact import models
from capslip.contact.models.caps import caps as caps_curve
from capslip.contact.rung import Scene, contacts_of_caps, ladder, rung
from capslip.errors import SettingsError
from scenes import caps_map

CONTACT = Path(models.__file__).parents[1]
FILES = sorted(CONTACT.rglob("*.py"))
NAMES = registry.names("contact.models")
# Six equal caps, so that neither their families nor their neighbours make much of a difference
PLACES = [(0.010, 0.008), (0.030, 0.012), (0.050, 0.010), (0.012, 0.030), (0.032, 0.033)]
CAPS = [(x_m, y_m, 20.0, 0.5e-6) for x_m, y_m in [*PLACES, (0.050, 0.028)]]
TOY = '''"""Springs of one stiffness under the caps: a model that only a test wants."""

from dataclasses import replace

from capslip.contact.curve import in_series
from capslip.contact.models.caps import RUNG as CAPS

RUNG = replace(
    CAPS,
    name="toy",
    cost=2.5,
    automatic={automatic},
    build=lambda scene: replace(in_series(CAPS.build(scene), {compliance}), model="toy"),
)
'''


def face():
    return caps_map(CAPS, (200, 300), (2e-4, 2e-4))


def run(model):
    overrides = ("conditioning.form=none", "contact.preload_N=100", f"contact.model={model}")
    return capslip.analyze(face(), capslip.load_settings(overrides=overrides))


@pytest.fixture
def register(tmp_path, monkeypatch):
    """Return a function that makes a file in another folder a rung, for one test."""

    def add(compliance_m_per_N=0.0, automatic=False):
        text = TOY.format(automatic=automatic, compliance=compliance_m_per_N)
        (tmp_path / "toy.py").write_text(text, encoding="utf-8")
        monkeypatch.setattr(models, "__path__", [*models.__path__, str(tmp_path)])

    yield add
    sys.modules.pop("capslip.contact.models.toy", None)
    vars(models).pop("toy", None)


def test_a_file_is_a_rung_under_its_own_name():
    assert [rung(name).name for name in NAMES] == list(NAMES)
    costs = [one.cost for one in ladder()]
    assert costs == sorted(set(costs))
    assert [one.name for one in ladder() if not one.automatic] == ["flat", "boundary_elements"]
    assert len({one.colour for one in ladder()}) == len(NAMES)
    with pytest.raises(SettingsError, match=r"contact\.model: got .hertz.; expected one of"):
        rung("hertz")


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(CONTACT)))
def test_no_other_module_of_the_wing_names_a_rung(path):
    own = {path.stem} if path.parent.name == "models" else set()
    words = {
        node.value
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant)
    }
    assert words & set(NAMES) <= own


def test_the_list_of_rungs_loads_none_of_them():
    code = (
        "import sys; from capslip import registry; registry.names('contact.models');"
        "sys.exit('numpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("name", NAMES)
def test_what_a_rung_says_of_its_curve_holds(name):
    analysis = run("auto")
    one, state = rung(name), analysis.contact
    caps, surface = analysis.caps, analysis.conditioned.surface
    scene = Scene.of(caps, analysis.families, surface, analysis.settings, state.use)
    curve = one.build(scene)
    approach_m = float(curve.approach_m(100.0))
    found = one.contacts(scene, curve, approach_m)
    assert found.family.shape == curve.lift_off_m(approach_m).shape
    assert found.load_N.shape == (len(caps),)
    if one.made_from == "spheres":
        assert np.nansum(found.load_N) == pytest.approx(100.0, rel=1e-9)
        assert found.max_pressure_Pa >= 0.999999 * 1.5 * 100.0 / found.area_m2
    else:
        assert np.isnan(found.load_N).all()
    if one.solved_loads_N is not None:
        assert one.solved_loads_N(curve, 100.0)[-1] == 100.0
    # What holds the bulk sinks further under 100 N than the caps that stand alone
    alone_m = float(rung("caps").build(scene).approach_m(100.0))
    assert (approach_m > 1.02 * alone_m) == one.holds_bulk


def test_a_new_file_is_a_model_of_the_whole_program(register):
    register(1e-10)
    with pytest.raises(SettingsError, match=r"got 'toys'; expected one of .*did you mean toy\?"):
        run("toys")
    found, caps = run("toy"), run("caps")
    summary = found.summary()
    assert summary["contact"]["model"] == "toy"
    assert found.contact.approach_m == pytest.approx(caps.contact.approach_m + 100.0 * 1e-10)
    assert found.contact.max_pressure_Pa == pytest.approx(caps.contact.max_pressure_Pa)
    stiffness_N_per_m = [one.slip.tangential_stiffness_N_per_m for one in (found, caps)]
    assert 0.0 < stiffness_N_per_m[0] < 0.99 * stiffness_N_per_m[1]
    assert summary["damping"]["peak_loss_factor"] > 0.0
    np.testing.assert_allclose(found.caps.load_N, caps.caps.load_N)


def test_a_new_file_takes_part_in_the_automatic_choice(register):
    register(automatic=True)
    assert [one.name for one in ladder()].index("toy") == 3
    found, caps = run("toy"), run("caps")
    assert found.contact.estimated_error == caps.contact.estimated_error
    assert found.contact.estimated_error is not None


def test_the_contacts_of_caps_are_hertzian_and_their_resultant_lies_between_them():
    """Two spheres of one radius, the second too low to touch, and a third sphere."""
    x_m, y_m = np.array([0.01, 0.02, 0.05]), np.array([0.03, 0.01, 0.02])
    radius_m, low_m = np.array([20.0, 20.0, 5.0]), np.array([0.0, 9e-7, 1e-7])
    scene = scene_of(table(x_m, y_m, radius_m, -low_m), 50.0)
    curve = caps_curve(radius_m, low_m, E_STAR_PA)
    found = contacts_of_caps(scene, curve, 4e-7)
    depth_m = np.array([4e-7, 0.0, 3e-7])
    load_N = 4 / 3 * E_STAR_PA * np.sqrt(radius_m) * depth_m**1.5
    assert found.load_N == pytest.approx(load_N)
    assert found.count == 2
    assert found.area_m2 == pytest.approx(np.pi * (radius_m * depth_m).sum())
    pressure_Pa = 2 * E_STAR_PA / np.pi * np.sqrt(depth_m / radius_m)
    assert found.max_pressure_Pa == pytest.approx(pressure_Pa.max())
    assert found.resultant_m == pytest.approx(
        (load_N @ x_m / load_N.sum(), load_N @ y_m / load_N.sum())
    )
