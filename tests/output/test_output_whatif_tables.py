"""The tables of the what-if panel, read in Python as its page reads them."""

import base64
from dataclasses import replace

import numpy as np
import output_cases
import pytest

from capslip.analysis import analyze, analyze_families
from capslip.contact.models.caps import caps
from capslip.contact.rung import ModelError
from capslip.contact.varying_load import varying
from capslip.errors import ContactError
from capslip.output import whatif
from capslip.output.whatif import LEAST, PRELOADS, TOLERANCE, _columns, whatif_data
from capslip.pressing import under_preload
from capslip.result import JointOfScans
from capslip.settings import SlipSettings, load_settings
from capslip.structure.answer import answer_to
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap

E_STAR_PA, RADIUS_M, LOAD_N = 110e9, 2.0, 40.0


def hertz(e_m, d_m):
    """Return load drop and loss integral of a sphere at d, L = 4 integral of s (e - s) N'' ds.

    With s = d - t^2 what is summed is a polynomial, of which Gauss' three points know the integral.
    """
    k, (node, weight) = (
        4.0 / 3.0 * E_STAR_PA * np.sqrt(RADIUS_M),
        np.polynomial.legendre.leggauss(3),
    )
    least, most, x = np.sqrt(d_m - e_m)[:, None], np.sqrt(d_m), 0.5 * (node + 1.0)
    width = e_m[:, None] / (least + most)
    t = least + width * x
    terms = width**3 * x * (1.0 - x) * (most + t) * (t + least)
    drop_N = k * e_m * (d_m**2 + d_m * (d_m - e_m) + (d_m - e_m) ** 2)
    return drop_N / (d_m**1.5 + (d_m - e_m) ** 1.5), 6.0 * k * terms @ (0.5 * weight)


def cubic(at, u, value, slope):
    """Read a table by the cubics of Hermite."""
    i = np.clip(np.searchsorted(u, at, side="right") - 1, 0, len(u) - 2)
    step = u[i + 1] - u[i]
    t = (at - u[i]) / step
    ends = (1.0 + 2.0 * t) * (1.0 - t) ** 2 * value[i] + t**2 * (3.0 - 2.0 * t) * value[i + 1]
    return ends + step * t * (1.0 - t) * ((1.0 - t) * slope[i] - t * slope[i + 1])


def test_cubics_between_the_nodes_are_hertz():
    curve = caps([RADIUS_M], [0.0], E_STAR_PA)
    (u, D, D_slope, L, L_slope), error = _columns(curve, LOAD_N, 5.0)
    d_m = float(curve.approach_m(LOAD_N))
    assert np.exp(u[[0, -1]]) == pytest.approx([LEAST * d_m, d_m], rel=1e-12)
    assert (np.diff(u) > 0.0).all()
    assert 0.0 < error <= TOLERANCE
    e_m = d_m * np.append(np.geomspace(1e-6, 0.05, 57), np.linspace(0.051, 0.999, 71))
    drop_N, loss_J = hertz(e_m, d_m)
    for values, slope, exact in ((D, D_slope, drop_N), (L, L_slope, loss_J)):
        read = np.exp(cubic(np.log(e_m), u, values, slope))
        assert read == pytest.approx(exact, rel=1e-6, abs=0.0)
    assert np.exp(D[-1]) == pytest.approx(LOAD_N, rel=1e-9)


def test_nodes_end_with_the_time_and_the_error_says_so():
    curve = caps([RADIUS_M], [0.0], E_STAR_PA)
    (few, *_), error = _columns(curve, LOAD_N, 0.0)
    (many, *_), less = _columns(curve, LOAD_N, 5.0)
    assert len(few) < len(many)
    assert less <= TOLERANCE < error < 0.1


def columns_of(table):
    text = base64.b64decode(table["columns"])
    return np.frombuffer(text, "<f8").reshape(-1, table["nodes"])


def test_the_panel_starts_from_the_joint_as_it_was_analysed(several):
    found, slip, damping = whatif_data(several), several.slip, several.damping
    preload_N = float(slip.preload_N)
    told = [table["preload_N"] for table in found["tables"]]
    given, most = (several.face, several.contact), several.contact.errors.greatest
    known = [
        under_preload(*given, share * preload_N, several.settings)[0].errors.greatest <= most
        for share in PRELOADS
    ]
    held = preload_N * np.array(PRELOADS)[known]
    assert told == pytest.approx([*held, preload_N])
    assert len(held) >= 2
    for load_N, table in zip(told, found["tables"], strict=True):
        _, D, _, _, _ = columns_of(table)
        assert np.exp(D[-1]) == pytest.approx(load_N, rel=1e-9)  # all of it is gone in the end
    assert found["cubic"]
    assert (found["friction"], found["kappa"]) == (slip.friction_coefficient, slip.kappa)
    assert found["modal_stiffness_N_per_m"] == damping.modal_stiffness_N_per_m
    assert found["joint_stiffness_N_per_m"] == damping.joint_stiffness_N_per_m
    assert found["amplitude_m"] == several.answer.amplitude_m
    assert found["unresolved"] == 0.0
    assert found["of_caps"]
    assert whatif_data(replace(several, answer=None))["amplitude_m"] is None


def test_a_face_that_yielded_or_an_uneven_joint_is_known_under_its_preload_alone(several):
    yielded = replace(several, contact=replace(several.contact, hardness_Pa=1e9))
    joint = replace(several.joint, load_N=np.array([1.0, 2.0]), weight=np.array([1.0, 1.0]))
    for one in (yielded, replace(several, joint=joint)):
        found = whatif_data(one)
        (table,) = found["tables"]
        assert table["preload_N"] == float(several.slip.preload_N)
        assert not found["of_caps"]


def balanced(*overrides):
    """Return a face that turns where its preload changes."""
    families = (CapFamily("G", 3, 24.0), CapFamily("P", 6, 24.0, 1e-7))
    surface, _ = synthetic_surface(Scene((100, 150), (4e-4, 4e-4), seed=4, families=families))
    given = ("contact.preload_N=200", *overrides)
    return analyze(surface, load_settings(overrides=given))


def at_a_quarter(table, friction, kappa):
    """Return energy and slip where a quarter of the load is gone."""
    u, D, D_slope, L, L_slope = columns_of(table)
    at = np.interp(np.log(0.25 * table["preload_N"]), D, u)
    e_m, loss_J = np.exp(at), np.exp(cubic(at, u, L, L_slope))
    assert np.exp(cubic(at, u, D, D_slope)) == pytest.approx(0.25 * table["preload_N"], rel=1e-2)
    return friction**2 * kappa * loss_J, friction * kappa * e_m


@pytest.mark.parametrize("held", [(), ("contact.alignment_stiffness_Nm_per_rad=2e5",)])
def test_another_preload_presses_the_caps_on_the_plane_that_it_balances(held):
    """Against what holds them upright, too, which is at ease as the face was levelled."""
    found = whatif_data(balanced(*held))
    assert len(found["tables"]) == 4
    for table in found["tables"][1:]:
        preload = f"contact.preload_N={table['preload_N']}"
        again = balanced(preload, "contact.model=interacting", *held)
        force_N = 0.25 * again.slip.total_slip_force_N
        told_J, told_m = at_a_quarter(table, found["friction"], found["kappa"])
        assert told_J == pytest.approx(float(again.slip.energy_at_force_J(force_N)), rel=0.02)
        assert told_m == pytest.approx(float(again.slip.displacement_m(force_N)), rel=0.02)


def test_a_preload_of_which_caps_know_less_than_is_asked_is_left_out(monkeypatch):
    analysis = balanced()
    pressed, slip = under_preload(analysis.face, analysis.contact, 100.0, analysis.settings)
    known = max(analysis.contact.errors.greatest, analysis.settings.contact.tolerance)

    def under(face, contact, preload_N, settings):
        if preload_N < 75.0:
            raise ContactError("tips over")
        off = known * (1.1 if preload_N < 125.0 else 0.9)
        return replace(pressed, errors=ModelError(off, off)), slip

    monkeypatch.setattr(whatif, "under_preload", under)
    assert [table["preload_N"] for table in whatif_data(analysis)["tables"]] == [150.0, 200.0]


def noisy(preload_N, model):
    """Return a face of caps with white noise, by a model that is forced."""
    families = (CapFamily("G", 3, 24.0), CapFamily("P", 6, 24.0, 1e-7))
    surface, _ = synthetic_surface(Scene((100, 150), (4e-4, 4e-4), seed=4, families=families))
    noise_m = 5e-9 * np.random.default_rng(1).standard_normal(surface.shape)
    surface = HeightMap(surface.height_m + noise_m, surface.pixel_size_m)
    given = (f"contact.preload_N={preload_N}", f"contact.model={model}")
    return analyze(surface, load_settings(overrides=given))


@pytest.mark.parametrize(
    ("model", "off_N", "left_N"),
    [
        ("interacting", 150.0, [200.0]),
        pytest.param("families", 100.0, [50.0, 200.0], marks=pytest.mark.long),
    ],
)
def test_of_a_forced_model_too_what_its_own_analysis_calls_off_is_left_out(model, off_N, left_N):
    forced, own = noisy(200.0, model), noisy(off_N, model).contact.errors.greatest
    assert own > 1.5 * max(forced.contact.errors.greatest, forced.settings.contact.tolerance)
    under, _ = under_preload(forced.face, forced.contact, off_N, forced.settings)
    assert under.errors.greatest == pytest.approx(own, rel=0.15)
    found = whatif_data(forced)
    assert found["error_known"]
    assert [table["preload_N"] for table in found["tables"]] == left_N


def test_of_given_families_the_error_is_known_under_their_own_preload_alone():
    families = [f"families.{one}" for one in ("m=4", "n=5", "radius_G_m=24", "radius_P_m=26")]
    families += ["families.h_m=1e-7", "joint.area_m2=24e-4"]
    found = analyze_families(load_settings(overrides=families))
    assert found.contact.errors is not None
    panel = whatif_data(found)
    assert panel["of_caps"]
    assert not panel["error_known"]
    assert len(panel["tables"]) == 1 + len(PRELOADS)


def test_a_joint_of_scans_is_resolved_no_finer_than_the_coarsest_of_them(several):
    pressed = output_cases.pressed_map()
    alone = whatif_data(pressed)["unresolved"]
    assert 0.0 < alone < 1.0
    of = {"settings": pressed.settings, "joint": pressed.joint, "timings_s": {}, "started": "now"}
    of |= {"slip": pressed.slip, "damping": pressed.damping, "answer": pressed.answer}
    joint = JointOfScans(**of, problems=(), scans=(several, pressed))
    assert whatif_data(joint)["unresolved"] == alone
    assert not whatif_data(joint)["of_caps"]


def test_without_slip_there_is_no_panel(several):
    assert whatif_data(replace(several, slip=None)) is None
    assert whatif_data(replace(several, damping=None)) is None


def test_no_panel_shows_a_constant_load_where_it_oscillates():
    """Its equations lose another energy than the answer beside it."""
    steady = output_cases.several()
    slip = varying(steady.slip, SlipSettings(normal_amplitude_ratio=0.3))
    answer, _ = answer_to(steady.settings.answer, slip, steady.damping)
    assert answer.energy_J != pytest.approx(steady.answer.energy_J, rel=0.1)
    assert whatif_data(steady) is not None
    assert whatif_data(replace(steady, slip=slip, answer=answer)) is None
