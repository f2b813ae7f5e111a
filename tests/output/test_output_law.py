"""The law as files: each is read back, or run, to the numbers that the analysis gives."""

import csv
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import msgspec
import numpy as np
import pytest

import capslip
from capslip.analysis import analyze_once, analyze_scans
from capslip.caps_hold import caps_hold
from capslip.contact.rung import rung
from capslip.contact.scaled import ScaledCurve
from capslip.contact.slip import slip_curve
from capslip.errors import ContactError
from capslip.output.export import export_named
from capslip.output.exports.law import (
    DECKS,
    EXPORT,
    FILES,
    UNITS,
    _inexact,
    _off,
    _without_level,
    deck,
)
from capslip.pressing import error_under, finding_caps_anew
from capslip.problems import Problem
from capslip.settings import Settings
from capslip.structure.interpolation import tables_of
from capslip.structure.law import law
from capslip.studies.faces.synthetic import synthetic_surface
from capslip.studies.limits.tries import hidden_family
from capslip.surface.heightmap import HeightMap
from scenes import caps_map, noisy_waves

FACE = Path(__file__).parents[2] / "sample_surfaces" / "paper_face_a.h5"
CAPS = [
    (4e-3 + 8e-3 * j, 4e-3 + 8e-3 * i, 4.0, -1e-8 * (i + j)) for i in range(3) for j in range(3)
]
FLATTER = [(x, y, 9.0, 3.0 * peak) for x, y, _, peak in CAPS[:6]]
AND = ("", "_scatter")  # of a name, the column of its mean and that of its scatter
DATA = re.compile(r"^[\d.e+-]+(?:, [\d.e+-]+)*$")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    analysis = analyze_once(capslip.load_surface(FACE), Settings())
    folder = tmp_path_factory.mktemp("law")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("capslip.output.exports.law.law", law_of)
        for name, value in {"RATIO": 10 ** (1 / 4), "BELOW": 8, "ABOVE": 2}.items():
            patch.setattr(f"capslip.structure.law.{name}", value)  # half as many over the range
        EXPORT.write(analysis, folder)
    return analysis, folder


def ask_for_few_sliders(patch):
    patch.setattr("capslip.structure.law.JENKINS_TOLERANCE", 0.5)
    patch.setattr("capslip.structure.jenkins.DISPLACEMENTS", 8)
    patch.setattr("capslip.structure.jenkins.SMALL_DISPLACEMENTS", 4)


@pytest.fixture(autouse=True)
def few_sliders(monkeypatch):
    """Ask for few: those of `written` and `of_two`, made before, are looked at."""
    ask_for_few_sliders(monkeypatch)


@pytest.fixture
def few_pressures(monkeypatch):
    """Ask for the pressures at which a law is looked at, and for none between or far above them."""
    few = {"RATIO_OF_OWN": 10 ** (1 / 8), "BELOW": 8, "BELOW_OF_OWN": 8, "MOST_TURNS": 0}
    for name, value in (few | dict.fromkeys(("ABOVE", "ABOVE_OF_OWN", "ABOVE_SOLVED"), 1)).items():
        monkeypatch.setattr(f"capslip.structure.law.{name}", value)


YIELDS = ("material.hardness_Pa=1e7", "contact.model=interacting")


@pytest.fixture(scope="module")
def yielding(tmp_path_factory):
    """Return the analysis of a face that yields, the folder of its law, and what is said of it."""
    analysis = analyze_once(capslip.load_surface(FACE), capslip.load_settings(overrides=YIELDS))
    folder = tmp_path_factory.mktemp("yielding")
    with pytest.MonkeyPatch.context() as patch:
        ask_for_few_sliders(patch)
        # Half as many pressures over the range, and more where the law needs them
        for name, value in {"RATIO": 10 ** (1 / 8), "BELOW": 16, "ABOVE": 4}.items():
            patch.setattr(f"capslip.structure.law.{name}_OF_OWN", value)
        return analysis, folder, EXPORT.write(analysis, folder)


FOUND = {}


def law_of(parts, *given):
    """Return the law of parts, found once of the same contacts: as whoever asks first wants it."""
    contacts = tuple(part.contact for part in parts)
    if contacts not in FOUND:
        FOUND[contacts] = law(parts, *(given or (0.2,)))
    return FOUND[contacts]


GOOD_SLIDERS = SimpleNamespace(energy_error=0.01)


@pytest.fixture
def same_law(monkeypatch):
    """Write the same numbers, whatever else is said of them."""
    monkeypatch.setattr("capslip.output.exports.law.law", law_of)


def table(path):
    """Read a CSV file; return its comment and its columns."""
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))
    columns = dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))
    return "\n".join(line for line in lines if line.startswith("#")), columns


def slip_at(analysis, p):
    """Return the slip curve per area under a pressure, at the level of that."""
    return slip_along(analysis, p, analysis.contact.of_patch(p * analysis.joint.scan_area_m2))


def slip_along(analysis, p, contact):
    """Return the slip curve per area under a pressure along the curve of a state."""
    area_m2, mu = analysis.joint.scan_area_m2, analysis.settings.material.friction_coefficient
    curve = ScaledCurve(contact.curve, 1 / area_m2)
    return slip_curve(curve, p, mu, contact.composite.kappa)


@pytest.mark.long
def test_every_file_is_there_and_no_other(written):
    _, folder = written
    assert {path.name for path in folder.iterdir()} == {*FILES, *DECKS.values()}
    assert set(EXPORT.files) == {*FILES, *DECKS.values()}


IN_THE_WAY = """
import resource, sys, types
from pathlib import Path
import numpy as np
from capslip.output.exports import law
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))  # of a file, as of a disk
law._columns = lambda found: {"pressure_Pa": np.arange(9e3)}
law._sliders = lambda found: (["pressure_Pa"], iter([(1.0,)]))
try:
    law._write_hdf5(types.SimpleNamespace(scans=1, tables=dict), ["a"], Path(sys.argv[1]))
except OSError as error:
    print(error.strerror)
"""


def test_a_file_that_finds_no_room_is_an_error_and_not_the_end_of_the_process(tmp_path):
    asked = [sys.executable, "-c", IN_THE_WAY, str(tmp_path / "law.h5")]
    ran = subprocess.run(asked, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "File too large\n", "")


@pytest.mark.long
def test_at_the_pressure_of_the_scan_it_is_the_slip_curve_of_the_analysis(written):
    analysis, folder = written
    about, law = table(folder / "law.csv")
    area_m2 = analysis.joint.scan_area_m2
    p = analysis.joint.nominal_pressure_Pa
    here = np.isclose(law["pressure_Pa"], p, rtol=1e-9)
    delta = law["displacement_m"][here]
    assert here.sum() > 40
    slip = analysis.slip
    np.testing.assert_allclose(law["shear_Pa"][here] * area_m2, slip.force_N(delta), rtol=1e-9)
    loss = law["loss_J_per_m2"][here] * area_m2
    np.testing.assert_allclose(loss, slip.energy_J(delta), rtol=1e-9)
    k_t = law["tangential_stiffness_Pa_per_m"][here][0] * area_m2
    assert k_t == pytest.approx(slip.tangential_stiffness_N_per_m, rel=1e-9)
    for word in (analysis.contact.model, "Masing", "friction coefficient 0.2", "Holds:", "Error:"):
        assert word in about


@pytest.mark.long
def test_json_and_hdf5_hold_the_same(written):
    _, folder = written
    _, law = table(folder / "law.csv")
    document = json.loads((folder / "law.json").read_text(encoding="utf-8"))
    with h5py.File(folder / "law.h5") as file:
        assert file.attrs["about"] == "\n".join(document["about"])
        for name in ("displacement_m", "shear_Pa", "loss_J_per_m2"):
            np.testing.assert_array_equal(np.ravel(document[name]), law[name])
            np.testing.assert_array_equal(np.ravel(file[name]), law[name])
            assert file[name].attrs["unit"] == document["units"][name] == UNITS[name]
        np.testing.assert_array_equal(np.unique(law["pressure_Pa"]), file["pressure_Pa"])
        _, sliders = table(folder / "law_jenkins.csv")
        for name, column in sliders.items():
            np.testing.assert_array_equal(column, file[f"sliders/{name}"])


@pytest.mark.long
def test_the_python_file_runs_alone(written, tmp_path):
    """In a process without this package: numpy and the two files are enough."""
    analysis, folder = written
    for name in ("law.py", "law.json"):
        shutil.copy(folder / name, tmp_path)
    p = analysis.joint.nominal_pressure_Pa * np.array([0.03, 0.4, 1.7])
    slips = [slip_at(analysis, one) for one in p]
    delta = np.array([0.4 * slip.total_slip_displacement_m for slip in slips])
    code = (
        "import json; from law import LawTables; law = LawTables.read('law.json');"
        f"p, delta = {p.tolist()}, {delta.tolist()};"
        "print(json.dumps([law.shear_Pa(delta, p).tolist(), law.loss_J_per_m2(delta, p).tolist()]))"
    )
    done = subprocess.run(
        [sys.executable, "-I", "-c", f"import sys; sys.path.insert(0, '.'); {code}"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    shear, loss = json.loads(done.stdout)
    assert shear == pytest.approx([s.force_N(x) for s, x in zip(slips, delta, strict=True)], 2e-3)
    assert loss == pytest.approx([s.energy_J(x) for s, x in zip(slips, delta, strict=True)], 0.02)


@pytest.mark.long
def test_sliders_sum_to_the_backbone(written):
    analysis, folder = written
    about, sliders = table(folder / "law_jenkins.csv")
    stated = float(re.search(r"cycle is within ([\d.]+)", about)[1])
    assert stated <= 0.02
    for p in np.unique(sliders["pressure_Pa"])[::4]:
        here = sliders["pressure_Pa"] == p
        k, limit = sliders["slider_stiffness_Pa_per_m"][here], sliders["slider_shear_Pa"][here]
        slip = slip_at(analysis, p)
        delta = np.geomspace(0.01, 2.0, 30) * slip.total_slip_displacement_m
        force = np.minimum(k * delta[:, None], limit).sum(axis=1)
        loss = (4 * limit * np.maximum(delta[:, None] - limit / k, 0)).sum(axis=1)
        np.testing.assert_allclose(force, slip.force_N(delta), rtol=stated / 4)
        np.testing.assert_allclose(loss, slip.energy_J(delta), rtol=1.1 * stated)


@pytest.fixture(scope="module")
def of_two(tmp_path_factory):
    """Two scans of one joint, the second of which is smaller, and their law."""
    faces = caps_map(CAPS, (240, 240)), caps_map(FLATTER, (160, 240))
    overrides = ("contact.model=caps", "joint.area_m2=0.01", "contact.preload_N=1e4")
    joint = analyze_scans(faces, capslip.load_settings(overrides=overrides))
    # One curve of each for all pressures, as where stiff parts hold it
    held = (replace(scan, contact=replace(scan.contact, at_level=None)) for scan in joint.scans)
    joint = replace(joint, scans=tuple(held))
    folder = tmp_path_factory.mktemp("two")
    EXPORT.write(joint, folder)
    return joint, folder


def test_the_law_of_two_scans_is_the_mean_of_their_own_made_by_hand(of_two):
    joint, folder = of_two
    about, law = table(folder / "law.csv")
    assert "mean of 2 scans by their areas" in about
    assert "scatter" in about
    names = ("normal_stiffness", "tangential_stiffness", "shear", "loss")
    for p in np.unique(law["pressure_Pa"])[::8]:
        here = law["pressure_Pa"] == p
        delta = law["displacement_m"][here]
        found = []
        for scan in joint.scans:
            slip = slip_at(scan, p)
            k_n = float(slip.curve.stiffness_N_per_m(slip.approach_m))
            found.append((k_n, k_n / slip.kappa, slip.force_N(delta), slip.energy_J(delta)))
        for name, one, two in zip(names, *found, strict=True):
            column, scatter = (next(of for of in law if of.startswith(name + more)) for more in AND)
            np.testing.assert_allclose(law[column][here], 0.6 * one + 0.4 * two, rtol=1e-7)
            off = np.abs(one - two) / np.sqrt(2.0)
            np.testing.assert_allclose(law[scatter][here], off, rtol=1e-5, atol=1e-9 * np.max(one))
    at = np.isclose(law["pressure_Pa"], 1e6, rtol=1e-9)
    delta = law["displacement_m"][at]
    np.testing.assert_allclose(law["shear_Pa"][at] * 0.01, joint.slip.force_N(delta), rtol=1e-7)
    loss = law["loss_J_per_m2"][at] * 0.01
    np.testing.assert_allclose(loss, joint.slip.energy_J(delta), rtol=1e-7)


def test_the_law_of_two_scans_reads_back_from_every_file(of_two):
    joint, folder = of_two
    _, law = table(folder / "law.csv")
    document = json.loads((folder / "law.json").read_text(encoding="utf-8"))
    with h5py.File(folder / "law.h5") as file:
        assert document["scans"] == file.attrs["scans"] == 2
        for name in ("shear_Pa", "shear_scatter_Pa", "loss_J_per_m2", "loss_scatter_J_per_m2"):
            np.testing.assert_array_equal(np.ravel(document[name]), law[name])
            np.testing.assert_array_equal(np.ravel(file[name]), law[name])
            assert file[name].attrs["unit"] == document["units"][name]
        of_p = "normal_stiffness_scatter_Pa_per_m"
        np.testing.assert_array_equal(document[of_p], file[of_p])
    stated = [
        float(one) / 100
        for one in re.findall(r"([\d.]+)% of (?:tau|w)", " ".join(document["about"]))
    ]
    tables = tables_of(document)
    p = joint.joint.nominal_pressure_Pa
    for other in (p, 0.37 * p, 0.013 * p):
        slips = [slip_at(scan, other) for scan in joint.scans]
        delta = np.linspace(0.05, 1.2, 30) * slips[0].total_slip_displacement_m
        tau, w = (
            sum(s * getattr(slip, of)(delta) for s, slip in zip((0.6, 0.4), slips, strict=True))
            for of in ("force_N", "energy_J")
        )
        asked = tau >= 0.1 * 0.2 * other
        np.testing.assert_allclose(tables.shear_Pa(delta, other)[asked], tau[asked], rtol=stated[0])
        loss = tables.loss_J_per_m2(delta, other)[asked]
        np.testing.assert_allclose(loss, w[asked], rtol=stated[1])


def test_the_sliders_of_two_scans_read_back(of_two, tmp_path):
    """Those of the law at a pressure, and those of the joint, which are these times its area."""
    joint, folder = of_two
    export_named("jenkins").write(joint, tmp_path)
    _, sliders = table(folder / "law_jenkins.csv")
    _, whole = table(tmp_path / "jenkins.csv")
    at = np.isclose(sliders["pressure_Pa"], 1e6, rtol=1e-9)
    per_area = sliders["slider_stiffness_Pa_per_m"][at], sliders["slider_shear_Pa"][at]
    of_joint = whole["stiffness_N_per_m"], whole["slip_force_N"]
    delta = np.geomspace(0.01, 2.0, 40) * joint.slip.total_slip_displacement_m
    for (k, limit), area_m2, error in ((per_area, 0.01, 0.02), (of_joint, 1.0, 0.01)):
        force = area_m2 * np.minimum(k * delta[:, None], limit).sum(axis=1)
        loss = area_m2 * (4 * limit * np.maximum(delta[:, None] - limit / k, 0)).sum(axis=1)
        np.testing.assert_allclose(force, joint.slip.force_N(delta), rtol=error / 4)
        np.testing.assert_allclose(loss, joint.slip.energy_J(delta), rtol=1.1 * error)


def cards_of(lines):
    """Return pressures and overclosures of a deck, and the numbers of its friction."""
    rows = [line.split(",") for line in lines if DATA.match(line)]
    p, d = np.array(rows[:-1], dtype=float).T
    assert (p[0], d[0]) == (0.0, 0.0)
    assert (np.diff(p) > 0).all()
    assert (np.diff(d) > 0).all()
    return p, d, [float(field) for field in rows[-1]]


@pytest.mark.parametrize("program", DECKS)
def test_the_cards_of_two_scans_have_the_stiffness_of_its_table(of_two, program):
    """Under each pressure both scans bear it: normal and shear stiffness are of one state."""
    joint, folder = of_two
    _, law = table(folder / "law.csv")
    lines = (folder / DECKS[program]).read_text(encoding="utf-8").splitlines()
    p, d, friction = cards_of(lines)
    first = np.unique(law["pressure_Pa"], return_index=True)[1]
    np.testing.assert_allclose(p[1:], law["pressure_Pa"][first], rtol=1e-12)
    np.testing.assert_allclose(d[1:], law["closure_m"][first], rtol=1e-12)
    k_n = law["normal_stiffness_Pa_per_m"][first]
    secant = np.diff(p[1:]) / np.diff(d[1:])
    assert (k_n[:-1] < secant).all()
    assert (secant < k_n[1:]).all()
    if program == "calculix":
        at = np.argmin(np.abs(p[1:] - 1e6))
        kappa = joint.scans[0].contact.composite.kappa
        assert friction[1] * kappa == pytest.approx(k_n[at], rel=1e-9)
    tables = tables_of(json.loads((folder / "law.json").read_text(encoding="utf-8")))
    np.testing.assert_allclose(tables.closure_m(p[1:]), d[1:], rtol=2e-3)


def test_the_cards_of_scans_of_unlike_kappa_are_pressed_and_do_not_slide(of_two):
    """Under pressure alone they close as those of one kappa do."""
    parts = [
        replace(part, contact=replace(part.contact, composite=composite))
        for part, kappa in zip(of_two[0].parts, (1.1, 1.6), strict=True)
        for composite in [replace(part.contact.composite, kappa=kappa)]
    ]
    unlike, alike = (
        cards_of(deck(found, "calculix", []).splitlines())
        for found in (law(parts, 0.2), law_of(of_two[0].parts))
    )
    np.testing.assert_allclose(unlike[:2], alike[:2], rtol=1e-12)


@pytest.mark.long
def test_the_cards_of_two_scans_that_yield_unload_from_their_pressure(of_two):
    """Each pressure has another curve, and both scans bear what is left of the one."""
    elastic, yields = law_of(of_two[0].parts), []
    for part in of_two[0].parts:
        curve, at_N = part.contact.curve, part.contact.preload_N

        def first(load_N, _, curve=curve, at_N=at_N):
            return ScaledCurve(curve, (load_N / at_N) ** 0.3)

        uncounted = replace(part.contact.rung, touching=None)  # such a curve has no caps
        contact = replace(part.contact, rung=uncounted, hardness_Pa=1e9, first=first, at_level=None)
        yields.append(replace(part, contact=contact))
    found = law(yields, 0.2)
    assert not found.has_beds_alone
    p, d, _ = cards_of(deck(found, "calculix", []).splitlines())
    i = found.at_scan_pressure
    assert p[-1] == pytest.approx(1e6, rel=1e-9)
    assert d[-1] == pytest.approx(found.closure_m[i], rel=1e-9)
    some = p > elastic.range_Pa[0]
    unloading = tables_of(elastic.tables()).closure_m(p[some])
    np.testing.assert_allclose(d[some], unloading, rtol=4e-3)
    assert abs(np.interp(3e5, found.pressure_Pa, found.closure_m) / np.interp(3e5, p, d) - 1) > 0.1
    secant = np.diff(p[-2:]) / np.diff(d[-2:])
    assert secant == pytest.approx(found.normal_stiffness_Pa_per_m[i], rel=0.05)


@pytest.mark.long
@pytest.mark.usefixtures("few_pressures")
@pytest.mark.parametrize("n_scans", [1, 2])
def test_the_cards_of_a_map_that_stands_higher_between_its_pixels_begin_where_it_touches(
    written, n_scans
):
    """Its approach counts from the highest pixel: it recovers more than that, and no less than 0.

    Here by a factor, so that the closure at any pressure is known; scans of one kind have that of
    each.
    """
    (part,), higher = written[0].parts, 1.15
    elastic, map_rung = (
        part.contact.curve,
        replace(rung("boundary_elements"), least_share=None, at_forces=None, touching=None),
    )

    def first(load_N, _):
        return ScaledCurve(elastic, 1.0, withdrawal=higher)

    contact = replace(
        part.contact, hardness_Pa=1e9, curve=first(0.0, 1.0), first=first, at_level=None
    )
    contact = replace(contact, rung=map_rung)
    found = law([replace(part, contact=contact, share=1.0 / n_scans)] * n_scans, 0.2)
    p, z, _ = cards_of(deck(found, "calculix", []).splitlines())
    known = higher * (elastic.approach_m(p[1:] * part.joint.scan_area_m2) - elastic.touch_m)
    np.testing.assert_allclose(z[1:], known, rtol=4e-3, atol=1e-5 * known[-1])
    # The closure of law.csv is that of law.py, and where all slips
    tables = tables_of(found.tables())
    np.testing.assert_allclose(found.closure_m, tables.closure_m(found.pressure_Pa), rtol=4e-3)
    slides_m = found.friction_coefficient * found.kappa * found.closure_m
    np.testing.assert_allclose(found.total_slip_displacement_m, slides_m, rtol=4e-3)


@pytest.mark.long
@pytest.mark.parametrize("program", DECKS)
def test_the_cards_hold_the_curve(written, program):
    analysis, folder = written
    lines = (folder / DECKS[program]).read_text(encoding="utf-8").splitlines()
    assert max(map(len, lines)) <= 100
    cards = [line for line in lines if not line.startswith("**")]
    assert cards[:2] == [
        "*SURFACE INTERACTION, NAME=CAPSLIP",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR",
    ]
    i = next(i for i, line in enumerate(cards) if line.startswith("*FRICTION"))
    assert all(DATA.match(line) for line in [*cards[2:i], *cards[i + 1 :]])
    assert all(len(field.strip()) <= 20 for line in cards[2:i] for field in line.split(","))
    p, d = np.array([line.split(",") for line in cards[2:i]], dtype=float).T
    assert (p[0], d[0]) == (0.0, 0.0)
    assert (np.diff(p) > 0).all()
    assert (np.diff(d) > 0).all()
    # One range: that of the table, which law.csv goes beyond
    page = " ".join(line.removeprefix("**").strip() for line in lines if line.startswith("**"))
    assert page.count("Holds: ") == page.count("keep to less") == 1
    assert f"Holds: up to {p[-1]:.4g} Pa, where the table ends: keep to less." in page
    assert "Keep to less" not in page
    for pressure, closure in zip(p[1::5], d[1::5], strict=True):
        slip = slip_along(analysis, pressure, analysis.contact)  # it unloads at one level
        assert closure == pytest.approx(slip.approach_m - slip.curve.touch_m, rel=1e-9)
    at = analysis.joint.nominal_pressure_Pa
    k_t = slip_at(analysis, at).tangential_stiffness_N_per_m
    mu, *stick = (float(field) for field in cards[i + 1].split(","))
    assert mu == 0.2
    if program == "calculix":
        assert stick == pytest.approx([k_t], rel=1e-9)
    else:
        assert float(cards[i].split("=")[1]) == pytest.approx(mu * at / k_t, rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("program", DECKS)
def test_the_cards_say_how_each_of_their_numbers_becomes_one_in_mm(written, program):
    lines = (written[1] / DECKS[program]).read_text(encoding="utf-8").splitlines()
    i = next(i for i, line in enumerate(lines) if line.startswith("** Metres, newtons"))
    said = " ".join(lines[i : i + 2]).replace("** ", "")
    assert "in mm, N and MPa divide pressures by 1e6, multiply overclosures" in said
    if program == "calculix":
        assert said.endswith("overclosures by 1e3 and divide the stick slope by 1e9.")
    else:  # its elastic slip is a length
        assert said.endswith("overclosures and the elastic slip by 1e3.")


BLOCKS = """*NODE, NSET=ALL
{nodes}
*ELEMENT, TYPE=C3D8, ELSET=BOTH
1,1,2,3,4,5,6,7,8
2,11,12,13,14,15,16,17,18
*MATERIAL, NAME=STIFF
*ELASTIC
1e15,0.
*SOLID SECTION, ELSET=BOTH, MATERIAL=STIFF
*SURFACE, NAME=BELOW
1,S2
*SURFACE, NAME=ABOVE
2,S1
*INCLUDE, INPUT=law_calculix.inp
*CONTACT PAIR, INTERACTION=CAPSLIP, TYPE=NODE TO SURFACE
ABOVE,BELOW
*NSET, NSET=BASE
1,2,3,4
*NSET, NSET=TOP
15,16,17,18
*BOUNDARY
BASE,1,3
{steps}"""
STEP = """*STEP
*STATIC
1.,1.
*BOUNDARY
TOP,1,1,{slip!r}
TOP,2,2,0.
TOP,3,3,{closure:.12e}
*NODE PRINT, NSET=TOP, TOTALS=ONLY
RF
*END STEP
"""


@pytest.mark.long
@pytest.mark.parametrize("of", ["written", "of_two"])
def test_calculix_presses_and_shears_two_blocks(of, request, tmp_path):
    """Two stiff blocks of 10 mm: the table by straight lines, then the stick slope."""
    if shutil.which("ccx") is None:
        pytest.skip("CalculiX (ccx) is not installed: the cards were parsed, not run")
    result, folder = request.getfixturevalue(of)
    shutil.copy(folder / "law_calculix.inp", tmp_path)
    side, corners = 0.01, ((0, 0), (1, 0), (1, 1), (0, 1))
    heights = ((0, 0.0), (4, side), (10, side), (14, 2 * side))
    nodes = [
        f"{start + i},{x * side},{y * side},{z}"
        for start, z in heights
        for i, (x, y) in enumerate(corners, 1)
    ]
    lines = (tmp_path / "law_calculix.inp").read_text(encoding="utf-8").splitlines()
    cards = [line for line in lines if DATA.match(line)]
    p, d = np.array([line.split(",") for line in cards[:-1]], dtype=float).T
    closure, slip = float(0.5 * (d[-9] + d[-8])), 1e-9
    steps = STEP.format(slip=0.0, closure=-closure) + STEP.format(slip=slip, closure=-closure)
    (tmp_path / "two.inp").write_text(BLOCKS.format(nodes="\n".join(nodes), steps=steps))
    subprocess.run(["ccx", "two"], cwd=tmp_path, capture_output=True, check=True, timeout=60)
    rows = re.findall(r"^ +(\S+) +(\S+) +(\S+)$", (tmp_path / "two.dat").read_text(), re.MULTILINE)
    pressed, sheared = (np.array(row, dtype=float) / side**2 for row in rows)
    assert -pressed[2] == pytest.approx(np.interp(closure, d, p), rel=1e-3)
    k_t = result.slip.tangential_stiffness_N_per_m / result.joint.area_m2
    assert sheared[0] == pytest.approx(k_t * slip, rel=3e-3)
    assert sheared[0] < 0.2 * -pressed[2]  # it sticks


@pytest.mark.long
# A face that yields comes to the same load by another way, and single pixels decide its detail
@pytest.mark.usefixtures("few_pressures", "fewer_points")
@pytest.mark.parametrize(("hardness", "off"), [((), 0.02), (("material.hardness_Pa=4e8",), 0.25)])
def test_the_law_of_a_map_says_how_sure_it_is_where_the_least_of_it_touches(
    tmp_path, hardness, off
):
    """The lower the pressure, the fewer pixels touch."""
    given = ("contact.model=boundary_elements", "contact.alignment=as_levelled", *hardness)
    settings = capslip.load_settings(overrides=(*given, "contact.nominal_pressure_Pa=1e6"))
    surface = noisy_waves(2e-9)
    analysis = capslip.analyze(surface, settings)
    EXPORT.write(analysis, tmp_path)
    least_Pa, error = said_of_the_least(tmp_path)
    assert "level: " not in page_of(tmp_path)  # as_levelled it stays as it is
    given = (*given, f"contact.nominal_pressure_Pa={least_Pa}")
    alone = capslip.load_settings(overrides=given)
    expected = capslip.analyze(surface, alone).contact.estimated_error
    assert error == pytest.approx(expected, rel=off)
    assert expected > 1.5 * analysis.contact.estimated_error


@pytest.mark.long
@pytest.mark.usefixtures("few_pressures", "fewer_points")
def test_the_law_of_an_uneven_joint_has_the_error_of_its_greatest_pressure_there(tmp_path):
    """Not that of the joint, which rests on lighter patches."""
    path = tmp_path / "pressures.csv"
    given = ("contact.model=boundary_elements", "contact.alignment=as_levelled")
    said = []
    for patches in ("1e6,1e-5\n", "1e6,1e-5\n1e5,1e-2\n"):
        path.write_text("pressure_Pa,area_m2\n" + patches)
        settings = capslip.load_settings(overrides=(*given, f"joint.pressure_map={path}"))
        analysis = capslip.analyze(noisy_waves(2e-9), settings)
        said.append(law_about(analysis, tmp_path / f"{len(said)}"))
    assert analysis.contact.estimated_error > 0.5
    assert said[0] == said[1]


def page_of(folder):
    """Return the page of a law as one line."""
    comment, _ = table(folder / "law.csv")
    return " ".join(line.removeprefix("# ") for line in comment.splitlines())


def said_of_the_least(folder):
    """Return the least pressure of a law, and the error that its page says for that."""
    least_Pa = float(table(folder / "law.csv")[1]["pressure_Pa"][0])
    said = r"at ([\d.e+]+) Pa, where the least of the face touches: ([\d.]+)%"
    found = re.search(said, page_of(folder))
    assert float(found[1]) == pytest.approx(least_Pa, rel=1e-3)
    return least_Pa, 0.01 * float(found[2])


def law_about(analysis, folder):
    """Return what a law says of the error of its model."""
    folder.mkdir()
    EXPORT.write(analysis, folder)
    comment, _ = table(folder / "law.csv")
    return re.search(r"Error: of the model, estimated at .*?%; at .*?%", comment)[0]


@pytest.mark.long
@pytest.mark.usefixtures("few_pressures")
def test_the_law_of_a_forced_model_without_its_error_says_none(tmp_path):
    settings = capslip.load_settings(overrides=("contact.model=interacting",))
    EXPORT.write(analyze_once(caps_map(CAPS, (240, 240)), settings), tmp_path)
    said = page_of(tmp_path)
    assert re.search(r"Error: of the model, estimated at \S+ Pa: not known\.", said)
    assert "least of the face" not in said


@pytest.mark.long
@pytest.mark.parametrize("model", ["auto", "interacting"])
def test_the_law_of_caps_says_how_sure_it_is_under_the_least_pressure(tmp_path, model):
    """Noise decides the more which of them touch, the lower that is."""
    noise = np.random.default_rng(5).standard_normal((240, 240))
    clean = caps_map(CAPS, (240, 240))
    noisy = HeightMap(clean.height_m + 4e-9 * noise, clean.pixel_size_m)
    # The load alone differs: the level is that of the pressure of the scan
    given = (f"contact.model={model}", "contact.alignment=as_levelled", "conditioning.form=none")
    sets = (*given, "contact.nominal_pressure_Pa=2e5")
    analysis = capslip.analyze(noisy, capslip.load_settings(overrides=sets))
    assert analysis.contact.rung.made_from == "spheres"
    EXPORT.write(analysis, tmp_path)
    least_Pa, error = said_of_the_least(tmp_path)
    sets = (*given, f"contact.nominal_pressure_Pa={least_Pa}")
    alone = capslip.analyze(noisy, capslip.load_settings(overrides=sets))
    assert alone.contact.model == analysis.contact.model
    assert error == pytest.approx(alone.contact.estimated_error, rel=0.05)
    assert alone.contact.estimated_error > 1.5 * analysis.contact.estimated_error


LOWER = [(8e-3 + 8e-3 * j, 8e-3 + 8e-3 * i, 4.0) for i in range(2) for j in range(2)]


@pytest.mark.long
@pytest.mark.parametrize(("lower_m", "last"), [(1.5e-7, 1), (2e-7, 3)])
def test_the_law_ends_where_hills_touch_that_the_cut_left_out(tmp_path, lower_m, last):
    surface = caps_map([*CAPS, *((*one, -lower_m) for one in LOWER)], (240, 240))
    given = ("contact.model=interacting", "contact.alignment=as_levelled")
    shallow = (*given, "contact.preload_N=100", "hills.cut=fixed", "hills.material_ratio=0.02")
    analysis = analyze_once(surface, capslip.load_settings(overrides=shallow))
    assert analysis.contact.contacts == len(CAPS)
    EXPORT.write(analysis, tmp_path)
    p = np.unique(table(tmp_path / "law.csv")[1]["pressure_Pa"])
    assert p[-1] == pytest.approx(analysis.joint.nominal_pressure_Pa * 10 ** (last / 8))
    assert "no cap of the curve stands" in page_of(tmp_path)
    contacts = []
    for step in (last, last + 1):
        sets = (*given, f"contact.preload_N={100 * 10 ** (step / 8)}")
        deep = analyze_once(surface, capslip.load_settings(overrides=sets))
        contacts.append(deep.contact.contacts)
    assert contacts == [len(CAPS), len(CAPS) + len(LOWER)]


@pytest.mark.long
def test_a_plane_below_the_cut_touches_no_more_than_caps_where_all_beside_them_is_sunk(written):
    """Contacts sink what lies around them: as an analysis under the greatest pressure finds it."""
    analysis, folder = written
    _, law = table(folder / "law.csv")
    assert law["pressure_Pa"].max() == pytest.approx(
        np.sqrt(10.0) * analysis.joint.nominal_pressure_Pa
    )
    sets = (f"contact.preload_N={np.sqrt(10.0) * 460}", "contact.model=interacting")
    more = analyze_once(capslip.load_surface(FACE), capslip.load_settings(overrides=sets))
    assert more.level.missed_area_m2 == 0.0
    slip = slip_along(analysis, law["pressure_Pa"].max(), analysis.contact)
    k_t = slip.tangential_stiffness_N_per_m * analysis.joint.scan_area_m2
    assert k_t == pytest.approx(more.slip.tangential_stiffness_N_per_m, rel=5e-3)
    caps = analysis.caps.peak_height_m[analysis.caps.usable]
    assert more.contact.approach_m > caps.max() - analysis.hills.cut_height_m


@pytest.mark.long
def test_caps_do_not_hold_where_another_one_touches_or_nobody_can_look(written):
    analysis = written[0]
    face, contact, settings = analysis.face, analysis.contact, analysis.settings
    for load_N, without_label in ((460.0, True), (800.0, False)):  # the plane reaches the cut
        assert caps_hold(face, contact, load_N, settings)
        found = caps_hold(replace(face, label=None), contact, load_N, settings)
        assert found == without_label
    use = contact.use & (np.arange(contact.use.size) != np.nanargmin(analysis.caps.load_N))
    assert not caps_hold(face, replace(contact, use=use), 460.0, settings)
    assert caps_hold(face, replace(contact, rung=rung("families"), use=use), 460.0, settings)
    assert not caps_hold(face, contact, 1e12, settings)  # contacts run together


def test_the_scan_whose_caps_hold_least_ends_the_law(of_two, tmp_path, monkeypatch):
    joint = of_two[0]
    first, second = (scan.contact.preload_N for scan in joint.scans)

    def holds(face, contact, load_N, settings):
        return contact is joint.scans[0].contact or load_N < 2.0 * second

    assert first != second
    monkeypatch.setattr("capslip.output.exports.law.caps_hold", holds)
    EXPORT.write(joint, tmp_path)
    p = table(tmp_path / "law.csv")[1]["pressure_Pa"]
    assert p.max() == pytest.approx(1e6 * 10 ** (2 / 8))
    assert "no cap of the curve stands" in page_of(tmp_path)


def law_against_analyses(analysis, folder, surface, given, off):
    """Hold the law under less pressure against analyses there.

    Returned is by what one level for all pressures would be off, of stiffness and loss, (3, 2).
    """
    columns = table(folder / "law.csv")[1]
    of = [columns[name] for name in ("pressure_Pa", "tangential_stiffness_Pa_per_m")]
    of += [columns["shear_Pa"], columns["loss_J_per_m2"]]
    pressures_Pa = np.unique(of[0])
    p0, area_m2 = analysis.joint.nominal_pressure_Pa, analysis.joint.scan_area_m2
    mu, kappa = analysis.slip.friction_coefficient, analysis.contact.composite.kappa
    kept = []
    for share in (0.5, 0.25, 0.1):
        p = float(pressures_Pa[np.argmin(np.abs(pressures_Pa - share * p0))])
        k_t, tau, w = (column[of[0] == p] for column in of[1:])
        load_N, known = p * area_m2, (tau > 0.0) & (w > 0.0)
        sets = (f"contact.preload_N={load_N}", *given)
        anew = analyze_once(surface, capslip.load_settings(overrides=sets))
        assert anew.contact.model == analysis.contact.model
        stiffness = float(anew.slip.tangential_stiffness_N_per_m)
        assert k_t[0] * area_m2 == pytest.approx(stiffness, rel=off)
        force_N = tau[known] * area_m2
        asked = (force_N > 0.2 * mu * load_N) & (force_N < 0.9 * mu * load_N)
        loss_J = np.array([anew.slip.energy_at_force_J(one) for one in force_N[asked]])
        assert w[known][asked] * area_m2 == pytest.approx(loss_J, rel=off)
        curve = analysis.contact.under(load_N).curve
        at_one = slip_curve(curve, load_N, mu, kappa)
        lost_J = np.array([at_one.energy_at_force_J(one) for one in force_N[asked]])
        of_stiffness = float(at_one.tangential_stiffness_N_per_m) / stiffness - 1.0
        kept.append((of_stiffness, np.abs(lost_J / loss_J - 1.0).max()))
    return np.abs(kept)


# Their heights lie in no plane, so each load finds another level
LOWER_BY_M = (0.0, 2e-7, 5e-8, 3e-7, 1e-7, 0.0, 1.5e-7, 4e-7, 2.5e-7)
UNEVEN = [(x, y, R, -low) for (x, y, R, _), low in zip(CAPS, LOWER_BY_M, strict=True)]


@pytest.mark.long
@pytest.mark.usefixtures("few_pressures")
@pytest.mark.parametrize("hardness", [(), ("material.hardness_Pa=1e7",)])
def test_the_law_of_caps_is_that_of_analyses_under_each_pressure(tmp_path, hardness):
    """Where it yields each pressure was reached for the first time, at its own level."""
    given, surface = ("contact.model=interacting", *hardness), caps_map(UNEVEN, (240, 240))
    analysis = analyze_once(surface, capslip.load_settings(overrides=given))
    EXPORT.write(analysis, tmp_path)
    kept = law_against_analyses(analysis, tmp_path, surface, given, 1e-2)
    assert kept[:, 1].max() > 0.3  # else nothing would turn


@pytest.mark.long
def test_the_law_of_caps_that_are_cut_and_fitted_anew_is_that_of_analyses(tmp_path, monkeypatch):
    """P-caps near the cut hardly touch, and the face leans on them under less."""
    surface, _ = synthetic_surface(hidden_family(0.3e-6, 13510), "hidden")
    analysis, given = analyze_once(surface, capslip.load_settings()), []

    def asked(parts, *_):
        given.extend(parts)
        raise ContactError("no table is needed")

    monkeypatch.setattr("capslip.output.exports.law.law", asked)
    with pytest.raises(ContactError, match="no table"):
        EXPORT.write(analysis, tmp_path)
    (part,), contact = given, analysis.contact
    mu, off = analysis.slip.friction_coefficient, []
    for factor in (0.3, 2.0):
        load_N = factor * contact.preload_N
        sets = (f"contact.preload_N={load_N!r}", f"contact.model={contact.model}")
        slip = analyze_once(surface, capslip.load_settings(overrides=sets)).slip
        force_N = np.array([0.1, 0.25, 0.5]) * mu * load_N
        for one in (part.contact, contact):
            patch = one.of_patch(load_N)
            found = slip_curve(patch.curve, load_N, mu, patch.composite.kappa)
            K = found.tangential_stiffness_N_per_m / slip.tangential_stiffness_N_per_m
            W = found.energy_at_force_J(force_N) / slip.energy_at_force_J(force_N)
            off.append(np.abs(np.append(K, W) - 1.0).max())
    anew, kept = off[::2], off[1::2]
    assert max(anew) < 1e-6
    assert min(kept) > 0.3  # else nothing would have to be found anew


@pytest.mark.long
def test_caps_that_stay_are_not_sought_under_each_pressure(written):
    """As each costs as much as the level of the analysis."""
    analysis, _ = written
    given = analysis.face, analysis.contact, analysis.settings
    assert finding_caps_anew(*given) is analysis.contact


@pytest.mark.long
@pytest.mark.usefixtures("few_pressures", "fewer_points")
@pytest.mark.parametrize("hardness", [(), ("material.hardness_Pa=4e8",)])
def test_the_law_of_a_map_is_that_of_analyses_under_each_pressure(tmp_path, hardness):
    given = ("contact.model=boundary_elements", *hardness)
    sets = (*given, "contact.nominal_pressure_Pa=1e6")
    surface = noisy_waves(2e-9)
    analysis = analyze_once(surface, capslip.load_settings(overrides=sets))
    EXPORT.write(analysis, tmp_path)
    assert law_against_analyses(analysis, tmp_path, surface, given, 0.05).max() > 0.2


@pytest.mark.long
def test_the_error_of_caps_that_turn_is_known_under_less(written):
    """What lies beside the caps turns with them, so it does not seem to touch."""
    analysis, _ = written
    face, contact, settings = analysis.face, analysis.contact, analysis.settings
    load_N = 0.1 * contact.preload_N
    alone = capslip.load_settings(overrides=(f"contact.preload_N={load_N}",))
    expected = analyze_once(capslip.load_surface(FACE), alone).contact.estimated_error
    assert error_under(face, contact, load_N, settings).greatest == pytest.approx(expected, rel=0.1)


def test_pressures_that_find_no_level_are_named(of_two, tmp_path):
    """There the scan lies as it was analysed."""
    analysis = of_two[0].scans[0]
    none_below_N = 0.3 * analysis.contact.preload_N

    def at_level(load_N):
        return None if load_N < none_below_N else analysis.contact.under(load_N)

    contact = replace(analysis.contact, at_level=at_level)
    (part,) = analysis.parts
    found = law((replace(part, contact=contact),), 0.2)
    p = found.pressure_Pa[found.pressure_Pa < 0.3 * found.scan_pressure_Pa]
    assert found.no_level_Pa == tuple(p.tolist())
    (line,) = _without_level(found)
    assert f"under {p.size} of the {found.pressure_Pa.size} pressures" in line
    assert f"from {p[0]:.4g} to {p[-1]:.4g} Pa" in line
    assert _without_level(replace(found, no_level_Pa=())) == []


@pytest.mark.usefixtures("few_pressures")
def test_a_level_that_stays_leaves_one_bed():
    """Nine caps in a square, whose load point is in their middle, do not turn under any load."""
    caps = [(x, y, R, 0.0) for x, y, R, _ in CAPS]
    surface, stiffness = caps_map(caps, (240, 240)), []
    for alignment in ("balanced", "as_levelled"):
        sets = (f"contact.alignment={alignment}", "contact.model=interacting")
        analysis = analyze_once(surface, capslip.load_settings(overrides=sets))
        found = law(analysis.parts, 0.2)
        assert found.has_beds_alone
        assert found.no_level_Pa == ()
        stiffness.append(found.tangential_stiffness_Pa_per_m)
    assert stiffness[0] == pytest.approx(stiffness[1], rel=1e-6)


def test_doubts_go_with_the_law(of_two, tmp_path, same_law):
    """What makes an analysis doubtful stands in every file of its law that holds a page."""
    analysis = of_two[0].scans[0]
    doubt = Problem("contact_under_resolved", "warning", "the map is too coarse here")
    EXPORT.write(replace(analysis, problems=(doubt,)), tmp_path)
    for name in ("law.csv", "law.json", "law_jenkins.csv", *DECKS.values()):
        assert "the map is too coarse here" in (tmp_path / name).read_text(encoding="utf-8")
    assert "check" in (tmp_path / "law.json").read_text(encoding="utf-8")


@pytest.mark.long
@pytest.mark.parametrize(("tolerance", "status"), [(1e-6, "check"), (0.9, "ok")])
def test_the_status_of_a_law_counts_what_the_law_says_of_itself(
    written, tmp_path, same_law, tolerance, status, monkeypatch
):
    monkeypatch.setattr("capslip.output.exports.law.UNUSABLE", tolerance)
    analysis, _ = written
    contact = msgspec.structs.replace(analysis.settings.contact, tolerance=tolerance)
    settings = msgspec.structs.replace(analysis.settings, contact=contact)
    told = EXPORT.write(replace(analysis, problems=(), settings=settings), tmp_path)
    warned = [problem.message for problem in told if problem.severity == "warning"]
    assert [problem.code for problem in told] == ["export_inexact"] * len(told)
    assert bool(warned) == (status == "check")
    for name in ("law.csv", "law_jenkins.csv", "law.json", "law.h5", *DECKS.values()):
        if name == "law.h5":
            with h5py.File(tmp_path / name) as file:
                text = file.attrs["about"]
        else:
            text = (tmp_path / name).read_text(encoding="utf-8")
        (said,) = re.findall(r"\(status:\s(?:\*\* |# )?(\w+)\)", text)
        assert said == status
        assert text.count("export_inexact: ") == len(warned)
    page = json.loads((tmp_path / "law.json").read_text(encoding="utf-8"))["about"]
    assert all(f"- export_inexact: {message}" in page for message in warned)


@pytest.mark.parametrize(
    ("loss_error", "severity"),
    [(0.04, None), (0.06, "info"), (0.9, "info"), (1.2, "warning"), (np.inf, "warning")],
)
def test_a_law_warns_where_it_tells_nothing_between_its_pressures(loss_error, severity):
    """A note elsewhere: a warning that comes with every law hides the others."""
    off = {"shear_error": 0.01, "loss_error": loss_error, "stiffness_error": 0.01}
    found = SimpleNamespace(**off, elements=(GOOD_SLIDERS,), resolved_share=np.array([0.1]))
    told = _inexact(found, 0.05)
    assert [problem.severity for problem in told] == ([] if severity is None else [severity])
    said = "not known how much" if np.isinf(loss_error) else f"up to {loss_error:.1%}"
    assert all(f"{said} of w" in problem.message for problem in told)


def test_a_folder_with_a_law_is_a_result_and_is_replaced(of_two, tmp_path, same_law):
    analysis = of_two[0].scans[0]
    light = {"figures": False, "render": False}
    capslip.write(analysis, tmp_path / "a", export="law", **light)
    assert all((tmp_path / "a" / name).is_file() for name in EXPORT.files)
    capslip.write(analysis, tmp_path / "a", **light)
    assert not any((tmp_path / "a" / name).exists() for name in EXPORT.files)


@pytest.mark.long
def test_without_slip_there_is_no_law(written, tmp_path):
    analysis, _ = written
    with pytest.raises(ContactError, match="needs a slip curve"):
        EXPORT.write(replace(analysis, slip=None), tmp_path)
    oscillates = capslip.load_settings(overrides=("slip.normal_amplitude_ratio=0.1",))
    with pytest.raises(ContactError, match="constant pressure"):
        EXPORT.write(replace(analysis, settings=oscillates), tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_the_law_of_a_face_that_yields_has_a_curve_for_each_pressure(yielding):
    """At the pressure of the scan that of the analysis, at others after another first loading."""
    analysis, folder, found = yielding
    about, law = table(folder / "law.csv")
    assert "yielded at 0.01 GPa" in about
    assert "p what the faces recover on unloading (closure)" in " ".join(about.split())
    error, _, doubts = about.partition("What makes it doubtful:")
    stated, again = (
        [float(one) / 100 for one in re.findall(r"([\d.]+)% of (?:tau|w)", text)]
        for text in (error, doubts)
    )
    assert len(stated) == 2
    assert again == []  # a note makes nothing doubtful
    assert stated[0] < 0.02
    assert stated[1] < 0.2  # where the lower caps touch first, between two pressures
    said = [problem for problem in found if problem.message.startswith("law.py differs")]
    assert [problem.severity for problem in said] == ["info"] * (max(stated) > 0.05)
    assert all(f"{stated[1]:.1%} of w" in problem.message for problem in said)
    tables = tables_of(json.loads((folder / "law.json").read_text(encoding="utf-8")))
    area_m2, p0 = analysis.joint.scan_area_m2, analysis.joint.nominal_pressure_Pa
    for p in (p0, 0.03 * p0, 0.26 * p0, 0.4 * p0, 0.3 * p0):
        slip = analysis.slip if p == p0 else slip_at(analysis, float(p))
        size = area_m2 if p == p0 else 1.0
        delta = np.array([0.1, 0.5, 0.9]) * slip.total_slip_displacement_m
        shear, loss = tables.shear_Pa(delta, p) * size, tables.loss_J_per_m2(delta, p) * size
        off = (1e-3, 5e-3) if p == p0 else stated
        np.testing.assert_allclose(shear, slip.force_N(delta), rtol=off[0])
        np.testing.assert_allclose(loss, slip.energy_J(delta), rtol=off[1])
    # Of what the pressure of the scan flattened
    one_bed = slip_along(analysis, p, analysis.contact).energy_J(delta)
    assert abs(one_bed[0] / slip.energy_J(delta[0]) - 1.0) > 0.02
    at_scan = np.isclose(law["pressure_Pa"], p0, rtol=1e-9)
    k_n = law["normal_stiffness_Pa_per_m"][at_scan][0]
    for file in DECKS.values():
        rows = [line for line in (folder / file).read_text().splitlines() if DATA.match(line)]
        cards = np.array([line.split(", ") for line in rows[:-1]], dtype=float)
        assert (np.diff(cards, axis=0) > 0.0).all()
        assert cards[0].tolist() == [0.0, 0.0]
        assert cards[-1, 0] == pytest.approx(p0, rel=1e-9)
        slope = np.diff(cards[-2:], axis=0)[0]
        assert slope[0] / slope[1] == pytest.approx(k_n, rel=2e-3)


@pytest.mark.parametrize("resolved", [0.1, 0.3])
def test_what_tables_are_off_is_said_of_each_of_the_three(resolved):
    off = {"shear_error": 0.011, "loss_error": 0.022, "stiffness_error": 0.066}
    said = _off(SimpleNamespace(**off, resolved_share=np.array([0.1, resolved])))
    assert said.startswith("up to 6.6% of the stiffness before slip; from a tenth of mu p on: up ")
    assert "up to 1.1% of tau" in said
    assert "up to 2.2% of w" in said
