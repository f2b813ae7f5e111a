"""Jenkins elements lose the energy of the slip curve that they replace."""

import numpy as np
import pytest

from capslip.contact.models.caps import caps
from capslip.contact.models.families import families
from capslip.contact.models.flat import flat
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.errors import OutputError, SettingsError
from capslip.structure.jenkins import jenkins, write_jenkins


def cycle_energy_J(elements, amplitude_m):
    """March the springs and sliders through cycles of u, as the CSV file says to."""
    stiffness, limit_N = elements.stiffness_N_per_m, elements.slip_force_N
    z = np.zeros_like(limit_N)
    u_m = amplitude_m * np.sin(2 * np.pi * np.arange(1.25, 2.25 + 1e-12, 1 / 4000))
    force_N = []
    for u in np.concatenate([amplitude_m * np.sin(np.linspace(0, 2.5 * np.pi, 4001)), u_m]):
        f = np.clip(stiffness * (u - z), -limit_N, limit_N)
        z = u - f / stiffness
        force_N.append(f.sum())
    return abs(np.trapezoid(force_N[-len(u_m) :], u_m))


@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.005])
def test_energy_on_a_dense_grid(slip, tolerance):
    elements = jenkins(slip, tolerance)
    delta_m = np.geomspace(0.01, 3.0, 20011) * slip.total_slip_displacement_m
    error = elements.energy_J(delta_m) / slip.energy_J(delta_m) - 1
    greatest = np.abs(error).max()
    assert greatest <= tolerance
    assert elements.energy_error <= tolerance
    # What a structure imposes is the force.
    delta_m = np.geomspace(0.01, 1.0, 20011) * slip.total_slip_displacement_m
    knot_m = np.append(0.0, elements.slip_displacement_m)
    at_force_m = np.interp(slip.force_N(delta_m), elements.force_N(knot_m), knot_m)
    error = elements.energy_J(at_force_m) / slip.energy_J(delta_m) - 1
    assert np.abs(error).max() <= tolerance
    # The error that is claimed is that of the dense grid, nearly.
    assert 0.9 < elements.energy_error / max(greatest, np.abs(error).max()) < 1.01
    assert np.abs(elements.force_N(delta_m) / slip.force_N(delta_m) - 1).max() <= tolerance / 5


def test_few_elements_suffice(slip):
    assert len(jenkins(slip, 0.01).slip_force_N) < 60
    assert len(jenkins(slip, 0.1).slip_force_N) < 25


def test_sums_and_order(slip):
    elements = jenkins(slip)
    assert elements.stiffness_N_per_m.sum() == pytest.approx(
        float(slip.stiffness_N_per_m(0.0)), rel=1e-12
    )
    assert elements.slip_force_N.sum() == pytest.approx(slip.total_slip_force_N, rel=1e-12)
    assert (elements.stiffness_N_per_m > 0).all()
    assert (elements.slip_force_N > 0).all()
    assert (np.diff(elements.slip_displacement_m) > 0).all()
    assert elements.slip_displacement_m[-1] <= slip.total_slip_displacement_m


@pytest.mark.parametrize("share", [0.03, 0.3, 1.0, 1.5])
def test_marched_cycle(slip, share):
    elements = jenkins(slip)
    amplitude_m = share * slip.total_slip_displacement_m
    marched_J = cycle_energy_J(elements, amplitude_m)
    assert marched_J == pytest.approx(elements.energy_J(amplitude_m), rel=2e-3)
    assert marched_J == pytest.approx(slip.energy_J(amplitude_m), rel=0.012)


def test_below_the_range_up_to_two_times_as_much_is_lost_and_then_nothing(slip, tmp_path):
    """Sliders with the moments of an even density up to delta_0 lose 2.10 times as much at most."""
    elements = jenkins(slip, smallest_displacement_m=0.1 * slip.total_slip_displacement_m)
    assert len(elements.slip_force_N) < len(jenkins(slip).slip_force_N)
    first_m = elements.slip_displacement_m[0]
    assert elements.energy_J(0.999 * first_m) == 0
    delta_m = np.linspace(first_m, elements.smallest_displacement_m, 1001)[1:]
    assert (elements.energy_J(delta_m) / slip.energy_J(delta_m)).max() == pytest.approx(
        2.1, abs=0.4
    )
    write_jenkins(elements, tmp_path / "jenkins.csv")
    text = (tmp_path / "jenkins.csv").read_text()
    assert f"two times as much is\n# lost, and nothing up to {first_m:.6g} m." in text


def test_an_even_density_is_lost_two_times_in_the_first_cell():
    """Of one sphere far below gross slip, where W goes with delta^3 and T'' is even."""
    slip = slip_curve(families(1, 25.0, 0, 110e9), 100.0, 0.2, 1.2)
    elements = jenkins(slip, 0.05, 1e-4 * slip.total_slip_displacement_m)
    first_m, second_m = elements.slip_displacement_m[:2]
    low, high = 0.5 * (1.0 - 1.0 / np.sqrt(3.0)), 0.5 * (1.0 + 1.0 / np.sqrt(3.0))
    assert second_m / first_m == pytest.approx(high / low, rel=1e-3)
    x_m = np.linspace(1.0, 3.0, 2001) * first_m
    ratio = elements.energy_J(x_m) / slip.energy_J(x_m)
    assert ratio.max() == pytest.approx(4.0 / (9.0 * low), rel=1e-3)
    assert x_m[ratio.argmax()] == pytest.approx(1.5 * first_m, rel=0.01)


def test_units_rescale(spheres):
    here, there = jenkins(spheres((90.0, 6e-8))), jenkins(spheres((0.09, 6e-2)))
    np.testing.assert_allclose(there.slip_force_N, 1e-3 * here.slip_force_N, rtol=1e-9)
    np.testing.assert_allclose(there.slip_displacement_m, 1e6 * here.slip_displacement_m, rtol=1e-9)


def test_one_slider_is_one_element(one_slider):
    elements = jenkins(one_slider)
    np.testing.assert_allclose(elements.slip_force_N, [90.0])
    np.testing.assert_allclose(elements.stiffness_N_per_m, [3e9])
    assert elements.energy_error == 0


def test_reference_joint_and_many_caps():
    depth_m = np.append(0.0, np.random.default_rng(1).uniform(0, 4e-7, 199))
    for curve in (
        families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9),
        caps(np.full(200, 25.0), depth_m, 109.89e9),
    ):
        slip = slip_curve(curve, 460.4, 0.2, 1.2143)
        elements = jenkins(slip)
        delta_m = np.geomspace(0.01, 2.0, 5003) * slip.total_slip_displacement_m
        np.testing.assert_allclose(elements.energy_J(delta_m), slip.energy_J(delta_m), rtol=0.01)
        assert elements.slip_force_N.sum() == pytest.approx(0.2 * 460.4, rel=1e-12)
        assert len(elements.slip_force_N) < 60


def test_rigid_joint_has_no_elements():
    with pytest.raises(SettingsError, match="flat contact model has no displacement"):
        jenkins(slip_curve(flat(460.0), 460.0, 0.2, 1.2143))


def test_file_gives_back_every_digit(spheres, tmp_path):
    elements = jenkins(spheres((90.0, 6e-8), (3.0, 2e-9)))
    path = tmp_path / "jenkins.csv"
    write_jenkins(elements, path)
    lines = path.read_text(encoding="utf-8").splitlines()
    head = [line for line in lines if line.startswith("#")]
    assert lines[len(head)] == "stiffness_N_per_m,slip_force_N"
    assert max(len(line) for line in head) <= 100
    stiffness, force = np.loadtxt(path, delimiter=",", skiprows=len(head) + 1).T
    np.testing.assert_array_equal(stiffness, elements.stiffness_N_per_m)
    np.testing.assert_array_equal(force, elements.slip_force_N)


def test_bad_input(spheres, tmp_path):
    slip = spheres((90.0, 6e-8))
    for tolerance in (0.0, 0.001, 1.0, np.nan):
        with pytest.raises(SettingsError, match="tolerance: got"):
            jenkins(slip, tolerance)
    for smallest_m in (0.0, -1.0, 6e-8, np.nan):
        with pytest.raises(SettingsError, match="smallest_displacement_m: got"):
            jenkins(slip, smallest_displacement_m=smallest_m)
    with pytest.raises(OutputError, match="cannot be written"):
        write_jenkins(jenkins(slip), tmp_path / "missing" / "jenkins.csv")


def test_a_full_disk_leaves_the_older_file(spheres, tmp_path, half_written):
    elements, path = jenkins(spheres((90.0, 6e-8))), tmp_path / "jenkins.csv"
    path.write_text("older")
    half_written("write_text")
    with pytest.raises(OutputError, match=r"jenkins.csv cannot be written: .*; make room on its"):
        write_jenkins(elements, path)
    assert [one.name for one in tmp_path.iterdir()] == ["jenkins.csv"]
    assert path.read_text() == "older"


def test_an_energy_that_is_not_convex_is_lost_as_far_as_sliders_can():
    """As between the solved loads of a map: cells without a stiffness were left out."""
    slip = slip_curve(families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9), 460.4, 0.2, 1.2143)

    class Bent(SlipCurve):
        def energy_J(self, displacement_m):
            share = np.asarray(displacement_m) / slip.total_slip_displacement_m
            bump = np.exp(-(((share - 0.3) / 0.03) ** 2))
            return slip.energy_J(displacement_m) * (1.0 + 0.03 * bump)

        def stiffness_N_per_m(self, displacement_m):
            share = np.asarray(displacement_m) / slip.total_slip_displacement_m
            bump = np.exp(-(((share - 0.3) / 0.03) ** 2))
            return slip.stiffness_N_per_m(displacement_m) * (1.0 + 0.2 * bump)

    given = slip.curve, slip.preload_N, slip.approach_m, slip.friction_coefficient, slip.kappa
    elements = jenkins(Bent(*given))
    assert elements.energy_error < 0.05
    assert elements.slip_force_N.sum() == pytest.approx(slip.total_slip_force_N, rel=1e-9)
    delta_m = np.linspace(0.05, 1.5, 500) * slip.total_slip_displacement_m
    np.testing.assert_allclose(elements.energy_J(delta_m), slip.energy_J(delta_m), rtol=0.04)
    np.testing.assert_allclose(elements.force_N(delta_m), slip.force_N(delta_m), rtol=0.02)


def test_an_energy_in_proportion_to_the_displacement_needs_no_stiffness_without_end():
    """A map too coarse for the first slip: sliders at rest would be springs without end."""
    slip = slip_curve(families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9), 460.4, 0.2, 1.2143)

    class Coarse(SlipCurve):
        def energy_J(self, displacement_m):
            least_J = 4 * 0.01 * slip.total_slip_force_N * np.asarray(displacement_m)
            return np.maximum(slip.energy_J(displacement_m), least_J)

    given = slip.curve, slip.preload_N, slip.approach_m, slip.friction_coefficient, slip.kappa
    elements = jenkins(Coarse(*given))
    assert np.isfinite(elements.stiffness_N_per_m).all()
    assert (elements.slip_displacement_m > 0).all()
    assert elements.energy_error < 0.2
    assert elements.slip_force_N.sum() == pytest.approx(slip.total_slip_force_N, rel=1e-9)


class Doubled(SlipCurve):
    """Loses twice as much below two tenths of the way to total slip: no sliders do."""

    def energy_J(self, displacement_m):
        twice = np.asarray(displacement_m) < 0.2 * self.total_slip_displacement_m
        return super().energy_J(displacement_m) * (1.0 + twice)


def test_from_where_the_energy_is_as_good_as_asked(tmp_path):
    slip = slip_curve(families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9), 460.4, 0.2, 1.2143)
    given = slip.curve, slip.preload_N, slip.approach_m, slip.friction_coefficient, slip.kappa
    bent = Doubled(*given)
    elements = jenkins(bent, 0.05)
    good_m, D = elements.good_from_m(0.05), slip.total_slip_displacement_m
    assert 0.15 * D < good_m < 0.35 * D
    delta_m = np.linspace(0.01, 2.0, 4001) * D
    error = np.abs(elements.energy_J(delta_m) / bent.energy_J(delta_m) - 1.0)
    assert error[delta_m >= good_m].max() < 0.06
    assert error[(delta_m < good_m) & (delta_m > 0.8 * good_m)].max() > 0.06
    assert elements.energy_error == elements.energy_error_from(0.0) > 0.1
    share = slip.force_N(good_m) / slip.total_slip_force_N
    assert elements.energy_error_from(1.1 * share) <= 0.05 < elements.energy_error_from(0.7 * share)
    write_jenkins(elements, tmp_path / "jenkins.csv", 0.05)
    text = (tmp_path / "jenkins.csv").read_text()
    assert f"within 0.05 (relative) at amplitudes of u from\n# {good_m:.6g} m to gross slip" in text
    assert f"and within {elements.energy_error:.2g} from\n# {0.01 * D:.6g} m to gross" in text
    # An error that reads as the one asked for is told once, from the smallest displacement on
    write_jenkins(elements, tmp_path / "same.csv", 0.9999 * elements.energy_error)
    text = (tmp_path / "same.csv").read_text()
    assert text.count("within") == 1
    assert f"within {elements.energy_error:.2g} (relative) at amplitudes of u from\n# " in text
    assert f"from\n# {elements.smallest_displacement_m:.6g} m to gross slip" in text


def test_sliders_as_good_as_asked_are_so_from_the_smallest_displacement_on(slip):
    elements = jenkins(slip, 0.05)
    assert elements.good_from_m(0.05) == elements.smallest_displacement_m
    assert elements.smallest_displacement_m == pytest.approx(0.01 * slip.total_slip_displacement_m)


@pytest.mark.parametrize("share", [1e-8, 1e-12])
def test_the_smallest_displacement_may_be_tiny(slip, share):
    elements = jenkins(slip, 0.1, share * slip.total_slip_displacement_m)
    assert elements.energy_error <= 0.1
