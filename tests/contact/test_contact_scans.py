"""Several scans of one joint: closed forms of spheres, equal scans, and a face cut in parts."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import capslip
from capslip.analysis import analyze_once, analyze_scans
from capslip.contact.joint import curve_of_joint
from capslip.contact.material import composite
from capslip.contact.models.caps import caps
from capslip.contact.models.families import families
from capslip.contact.part_of_joint import STIFFNESS_BY_CHANCE
from capslip.contact.scans import curve_of_scans, kappa_of_scans
from capslip.contact.slip import slip_curve
from capslip.errors import ContactError, SettingsError
from scenes import caps_map

STEEL = composite((200e9, 200e9), (0.3, 0.3))
MU, N = 0.2, 460.0
NUMBERS = ("slip_force_N", "displacement_m", "tangential_stiffness_N_per_m", "energy_J")
CAPS = [
    (4e-3 + 8e-3 * j, 4e-3 + 8e-3 * i, 4.0, -1e-8 * (i + j)) for i in range(3) for j in range(3)
]


def equal_spheres(count, radius_m, more=()):
    radii = [radius_m] * count + [radius for radius, _ in more]
    return caps(radii, [0.0] * count + [-below for _, below in more], STEEL.E_star_Pa)


def sphere_states(delta_m, count, radius_m):
    """Slip force and energy of equal spheres that share N, as Mindlin and Deresiewicz wrote it."""
    d = (0.75 * N / count / (STEEL.E_star_Pa * np.sqrt(radius_m))) ** (2 / 3)
    limit = MU * STEEL.kappa * d
    q = np.maximum(1.0 - delta_m / limit, 0.0)
    T = MU * N * (1.0 - q**1.5)
    below = MU * N * (np.minimum(delta_m, limit) - 0.4 * limit * (1.0 - q**2.5))
    below += MU * N * np.maximum(delta_m - limit, 0.0)
    return T, 8.0 * below - 4.0 * T * delta_m


def slip_of(curves, share):
    return slip_curve(curve_of_scans(curves, N, share, [1.0] * len(curves)), N, MU, STEEL.kappa)


def slip_of_unlike(curves, share, kappa):
    """Return that of the joint, and those as if all of it were face as that of one scan."""
    of_joint = kappa_of_scans(curves, N, share, kappa)
    curve = curve_of_scans(curves, N, share, [one / of_joint for one in kappa])
    each = [slip_curve(one, N, MU, own) for one, own in zip(curves, kappa, strict=True)]
    return slip_curve(curve, N, MU, of_joint), each


def test_two_families_of_spheres_average_as_in_closed_form():
    """Also where those of one scan slip as a whole and those of the other one stick."""
    families, share = ((5, 4.0), (40, 0.5)), (0.3, 0.7)
    slip = slip_of([equal_spheres(*one) for one in families], share)
    delta_m = np.geomspace(1e-4, 1.5, 40) * slip.total_slip_displacement_m
    states = [sphere_states(delta_m, *one) for one in families]
    T, W = (sum(s * one[i] for s, one in zip(share, states, strict=True)) for i in (0, 1))
    assert slip.force_N(delta_m) == pytest.approx(T, rel=1e-9)
    assert slip.energy_J(delta_m) == pytest.approx(W, rel=1e-6)
    held = delta_m < slip.total_slip_displacement_m
    assert slip.displacement_m(T[held]) == pytest.approx(delta_m[held], rel=1e-9)
    assert slip.energy_at_force_J(T[held]) == pytest.approx(W[held], rel=1e-6)
    assert slip.total_slip_force_N == MU * N
    whole = float(slip.displacement_m(MU * N))
    assert whole == pytest.approx(slip.total_slip_displacement_m, rel=1e-6)


def test_the_order_of_scans_and_one_that_is_cut_in_two_change_nothing():
    one, two = equal_spheres(5, 4.0, [(3.0, 4e-8)]), equal_spheres(40, 0.5)
    T = np.linspace(0.0, MU * N, 30)
    expected = slip_of([one, two], (0.4, 0.6)).displacement_m(T)
    for curves, share in (([two, one], (0.6, 0.4)), ([one, two, one], (0.1, 0.6, 0.3))):
        assert slip_of(curves, share).displacement_m(T) == pytest.approx(expected, rel=1e-9)


def test_scans_under_a_map_of_pressures_are_the_sum_of_their_uneven_joints():
    load_N, weight = np.array([100.0, 180.0]), np.array([1.0, 2.0])
    joints = [curve_of_joint(equal_spheres(*one), load_N, weight) for one in ((5, 4.0), (40, 0.5))]
    slip = slip_of(joints, (0.5, 0.5))
    parts = [slip_curve(joint, N, MU, STEEL.kappa) for joint in joints]
    delta_m = np.geomspace(1e-3, 1.2, 20) * slip.total_slip_displacement_m
    for name in ("force_N", "energy_J"):
        expected = sum(0.5 * getattr(part, name)(delta_m) for part in parts)
        assert getattr(slip, name)(delta_m) == pytest.approx(expected, rel=1e-12)
    assert slip.force_N(slip.displacement_m(60.0)) == pytest.approx(60.0, rel=1e-12)


@pytest.mark.parametrize("uneven", [False, True])
@pytest.mark.parametrize("kappa", [(1.4, 1.1), (1.1, 1.4)])
def test_scans_of_unlike_kappa_move_together_and_add_up(kappa, uneven):
    """Also where that which closes less under the preload is the last to slip as a whole."""
    curves, share = [equal_spheres(5, 4.0), equal_spheres(6, 4.0, [(3.0, 4e-8)])], (0.3, 0.7)
    if uneven:
        load_N, weight = np.array([100.0, 180.0]), np.array([1.0, 2.0])
        curves = [curve_of_joint(one, load_N, weight) for one in curves]
    slip, each = slip_of_unlike(curves, share, kappa)
    assert slip.total_slip_displacement_m == pytest.approx(
        max(one.total_slip_displacement_m for one in each), rel=1e-12
    )
    delta_m = np.geomspace(1e-3, 1.5, 40) * slip.total_slip_displacement_m
    for name in ("force_N", "energy_J", "stiffness_N_per_m"):
        expected = sum(s * getattr(one, name)(delta_m) for s, one in zip(share, each, strict=True))
        assert getattr(slip, name)(delta_m) == pytest.approx(expected, rel=1e-9), name
    assert slip.force_N(slip.displacement_m(60.0)) == pytest.approx(60.0, rel=1e-9)
    K = [one.curve.stiffness_N_per_m(one.approach_m) for one in each]
    normal = slip.curve.stiffness_N_per_m(slip.approach_m)
    assert normal == pytest.approx(np.dot(share, K), rel=1e-12)
    assert min(kappa) < slip.kappa < max(kappa)


def test_no_kappa_takes_an_uneven_joint_off_its_preload_by_rounding():
    load_N, weight = np.array([100.0, 180.0]), np.array([1.0, 2.0])
    joint = curve_of_joint(equal_spheres(5, 4.0), load_N, weight)
    for kappa in np.linspace(1.1, 1.5, 40):
        slip, each = slip_of_unlike([joint, joint], (0.5, 0.5), (1.2, float(kappa)))
        expected = 0.5 * sum(one.force_N(1e-8) for one in each)
        assert slip.force_N(1e-8) == pytest.approx(expected, rel=1e-12)
    with pytest.raises(ContactError, match="from their preload alone"):
        joint.load_drop_N((1.0 + 1e-12) * joint.preload_approach_m, 1e-8)


def test_scans_of_one_kappa_are_summed_as_they_are():
    curves, share = [equal_spheres(5, 4.0), equal_spheres(40, 0.5)], (0.3, 0.7)
    slip, _ = slip_of_unlike(curves, share, (1.3, 1.3))
    assert slip.kappa == 1.3
    assert slip.curve.curves == tuple(curves)


def ridges_map(along_x, other):
    """Four ridges that are long along x or y, of which the last is a little lower."""
    y, x = np.mgrid[0:60, 0:60] * 4e-4
    places = ((6e-3, 6e-3), (18e-3, 6e-3), (6e-3, 18e-3), (18e-3, 18e-3))
    radii_m = (other, 6.0) if along_x else (6.0, other)
    z = np.full(x.shape, -1e-6)
    for i, (x_m, y_m) in enumerate(places):
        rx, ry = radii_m
        hill = (x - x_m) ** 2 / (2 * rx) + (y - y_m) ** 2 / (2 * ry)
        z = np.maximum(z, -1e-8 * (i == 3) - hill)
    return capslip.HeightMap(z, (4e-4, 4e-4))


@pytest.mark.parametrize("asked", ["slip_force_N=20", "displacement_m=5e-9"])
def test_scans_whose_ridges_lie_across_each_other_are_the_sum_of_their_analyses(asked):
    faces = ridges_map(True, 60.0), ridges_map(False, 80.0)
    settings = settings_of(
        "joint.area_m2=0.00112896",
        "contact.preload_N=400",
        "slip.direction_rad=0.0",
        "material.poisson_ratio=[0.45, 0.45]",
        f"answer.{asked}",
    )
    found = analyze_scans(faces, settings)
    alone = [analyze_once(face, settings).slip for face in faces]
    assert alone[0].kappa > 1.2 * alone[1].kappa
    delta_m = found.answer.displacement_m
    for name, value in (("force_N", "slip_force_N"), ("energy_J", "energy_J")):
        expected = np.mean([float(getattr(one, name)(delta_m)) for one in alone])
        assert getattr(found.answer, value) == pytest.approx(expected, rel=1e-9)
    # Jackknife of two: half of what they differ by; what four contacts let expect counts as three
    # scans more, and t(0.95, 4) = 2.132 of both are to either side
    low, high = found.band.interval["tangential_stiffness_N_per_m"]
    off = np.log(alone[0].stiffness_N_per_m(0.0) / alone[1].stiffness_N_per_m(0.0))
    of_mean = STIFFNESS_BY_CHANCE / np.sqrt(4.0) / np.sqrt(2.0)
    half = 2.132 * np.hypot(0.5 * 0.5 * float(off), np.sqrt(0.75) * of_mean)
    assert np.log(high / low) == pytest.approx(2.0 * half, rel=0.1)
    assert found.band.contributions["tangential_stiffness_N_per_m"]["scans"] > 0.5


def settings_of(*more):
    return capslip.load_settings(overrides=("contact.model=caps", *more))


@pytest.mark.parametrize("asked", ["slip_force_N=900", "displacement_m=2e-9"])
def test_equal_scans_are_the_joint_of_one_of_them_and_scatter_by_chance_alone(asked):
    face = caps_map(CAPS, (240, 240))
    settings = settings_of("joint.area_m2=0.01", f"answer.{asked}", "contact.preload_N=1e4")
    one = capslip.analyze(face, settings)
    three = analyze_scans([face] * 3, settings)
    for name in NUMBERS:
        assert getattr(three.answer, name) == pytest.approx(getattr(one.answer, name), rel=1e-9)
    assert three.slip.force_N(one.slip.displacement_m(1200.0)) == pytest.approx(1200.0, rel=1e-9)
    assert three.damping.loss_factor == pytest.approx(one.damping.loss_factor, rel=1e-6)
    # They scatter by what their contacts let expect, which their mean has less of than one
    assert "scans" in three.band.contributions["energy_J"]
    wide = [np.log(np.divide(*of.band.interval["energy_J"][::-1])) for of in (three, one)]
    assert 0.5 * wide[1] < wide[0] < 0.9 * wide[1]
    assert "scatter between scans" in one.band.left_out
    assert "scatter between scans" not in three.band.left_out
    summary = three.summary()
    assert [scan["share"] for scan in summary["scans"]] == pytest.approx([1 / 3] * 3)
    assert summary["contact"]["coverage"] == pytest.approx(3 * one.joint.coverage)
    assert summary["contact"]["scan_load_N"] == pytest.approx(3 * one.joint.scan_load_N)
    assert "from 3 scans: " in three.verdict
    assert summary["scans"][1]["answer"]["energy_J"] == one.answer.energy_J


def test_scans_stand_for_the_joint_by_their_areas():
    faces = caps_map(CAPS, (240, 240)), caps_map(CAPS[:6], (160, 240))
    settings = settings_of("joint.area_m2=0.01", "answer.displacement_m=2e-9")
    found = analyze_scans(faces, settings)
    alone = [analyze_once(face, settings).answer for face in faces]
    for name in ("slip_force_N", "energy_J"):
        expected = 0.6 * getattr(alone[0], name) + 0.4 * getattr(alone[1], name)
        assert getattr(found.answer, name) == pytest.approx(expected, rel=1e-9)
    assert "from 2 scans, whose scatter rests on two: " in found.verdict


def test_a_scan_without_an_answer_leaves_the_joint_to_the_others_and_is_named():
    good = caps_map(CAPS, (240, 240))
    beside = caps_map([(4e-3, 4e-3, 4.0, 0.0)], (240, 240))
    settings = settings_of("joint.area_m2=0.01")
    found = analyze_scans([good, beside, good], settings)
    alone = analyze_once(good, settings).answer
    assert found.answer.energy_J == pytest.approx(alone.energy_J, rel=1e-9)
    assert found.status == "failed"
    assert "from 2 of 3 scans, whose scatter rests on two: " in found.verdict
    assert [scan["share"] for scan in found.summary()["scans"]] == [0.5, None, 0.5]
    nothing = analyze_scans([beside, beside], settings)
    assert nothing.answer is None
    assert nothing.band is None
    assert nothing.summary()["status"] == "failed"


@pytest.mark.parametrize(
    ("overrides", "count", "says"),
    [
        ((), 2, "joint.area_m2: got 2 scans"),
        ((), 2, r"expected joint\.area_m2 \(--area\)"),
        (("joint.area_m2=1",), 1, "scans: got 1"),
        (("joint.area_m2=1", "contact.model=flat"), 2, "contact.model: got flat"),
        (("joint.area_m2=1", "slip.normal_amplitude_ratio=0.1"), 2, "ratio: got 0.1 with 2 scans"),
    ],
)
def test_what_makes_no_joint_of_scans_is_refused(overrides, count, says):
    settings = capslip.load_settings(overrides=overrides)
    with pytest.raises(SettingsError, match=says):
        analyze_scans([caps_map(CAPS, (240, 240))] * count, settings)


@pytest.mark.long
def test_a_face_cut_in_four_is_the_sum_of_its_parts_and_the_whole_but_for_its_contacts():
    rng = np.random.default_rng(1)
    z = gaussian_filter(rng.standard_normal((240, 240)), 4, mode="wrap")
    z *= 2e-4 * 5e-5 / np.sqrt(np.mean(np.gradient(z)[0] ** 2))
    settings = capslip.load_settings(
        overrides=(
            "contact.nominal_pressure_Pa=1e6",
            "contact.model=interacting",
            "joint.area_m2=1.44e-4",
        )
    )
    quarters = [half for rows in np.split(z, 2) for half in np.split(rows, 2, axis=1)]
    faces = [capslip.HeightMap(part.copy(), (5e-5, 5e-5)) for part in (z, *quarters)]
    whole = analyze_once(faces[0], settings)
    found = analyze_scans(faces[1:], settings)
    delta_m = found.answer.displacement_m
    for name in ("force_N", "energy_J"):
        parts = np.mean([float(getattr(scan.slip, name)(delta_m)) for scan in found.scans])
        assert float(getattr(found.slip, name)(delta_m)) == pytest.approx(parts, rel=1e-9)
    n = np.mean([scan.contact.contacts for scan in found.scans])
    assert n > 25
    assert found.answer.slip_force_N == pytest.approx(whole.answer.slip_force_N, rel=1e-12)
    assert abs(1.0 - found.answer.energy_J / whole.answer.energy_J) < 1.5 / np.sqrt(n)
    assert found.band.contributions["energy_J"]["scans"] > 0.0


class _LetsGoOfLess:
    """A curve whose load drop up to lift-off is short of its load, as that of a map may be."""

    def __init__(self, curve):
        self.curve = curve

    def __getattr__(self, name):
        return getattr(self.curve, name)

    def load_drop_N(self, approach_m, withdrawal_m):
        return (1.0 - 1e-5) * self.curve.load_drop_N(approach_m, withdrawal_m)


def test_a_joint_carries_its_preload_though_a_map_lets_go_of_a_little_less():
    one = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    joint = curve_of_scans([one, _LetsGoOfLess(one)], 460.0, [0.5, 0.5], [1.0, 1.0])
    assert joint.approach_m(460.0) == joint.preload_approach_m
    slip = slip_curve(joint, 460.0, 0.3, 1.2)
    T = np.array([0.01, 0.5, 0.999]) * slip.total_slip_force_N
    alone = slip_curve(one, 460.0, 0.3, 1.2)
    assert slip.displacement_m(T) == pytest.approx(alone.displacement_m(T), rel=1e-3)
    with pytest.raises(ContactError, match="at most its preload"):
        joint.approach_m(460.01)
