"""Figures and tables of an analysis from Python: on whose axes, in which units, with what in."""

from dataclasses import replace

import numpy as np
import output_cases
import pytest

from capslip.errors import OutputError
from capslip.output.figures import FIGURES

CURVES = {"normal_curve": "normal_curve", "loop": "slip_loop", "energy": "energy"}
NAMES = {"height_map": "height_map", "caps": "hills_and_caps", "loss_factor": "loss_factor"}


@pytest.fixture
def plt():
    import matplotlib.pyplot as plt

    plt.switch_backend("agg")
    yield plt
    plt.close("all")


def lines(axes):
    """Return the curves of some axes, in the order in which they were drawn."""
    return [np.asarray(line.get_xydata(), dtype=float) for line in axes.get_lines()]


@pytest.mark.parametrize(("method", "name"), (CURVES | NAMES).items())
def test_a_plot_is_the_figure_of_the_report(method, name, several, plt):
    axes = getattr(several.plot, method)()
    assert axes.figure.number in plt.get_fignums()  # notebooks and galleries show it
    report = FIGURES[name].draw(several)
    assert tuple(axes.figure.get_size_inches()) == tuple(report.get_size_inches())
    drawn, expected = lines(axes), lines(report.axes[0])
    assert len(drawn) == len(expected)
    for one, other in zip(drawn, expected, strict=True):
        np.testing.assert_array_equal(one, other)
    assert axes.get_xlim() == report.axes[0].get_xlim()


@pytest.mark.parametrize("method", [*CURVES, *NAMES, "abbott", "spectrum"])
def test_axes_that_are_given_are_drawn_on_and_returned(method, several, plt):
    figure, (left, right) = plt.subplots(1, 2)
    assert getattr(several.plot, method)(ax=right) is right
    assert not left.has_data()
    assert plt.get_fignums() == [figure.number]
    assert right.get_legend() is not None
    assert not figure.legends  # the page is not ours
    figure.canvas.draw()


def test_the_abbott_curve_goes_through_the_cut(several, plt):
    axes = several.plot.abbott()
    curve, cut, point = lines(axes)
    cut_um = several.hills.cut_height_m * 1e6
    assert axes.get_ylabel() == "height [µm]"
    assert point[0] == pytest.approx([100.0 * several.hills.kept_fraction, cut_um])
    assert np.interp(point[0, 0], *curve.T) == pytest.approx(cut_um, abs=1e-3)
    assert list(cut[:, 0]) == [0.0, point[0, 0], point[0, 0]]


def test_one_deep_pit_does_not_flatten_the_abbott_curve(several, plt):
    surface = several.conditioned.surface
    height_m = surface.height_m.copy()
    height_m[3, 3] -= 1e-3
    pitted = replace(surface, height_m=height_m)
    conditioned = replace(several.conditioned, surface=pitted)
    low, high = replace(several, conditioned=conditioned).plot.abbott().get_ylim()
    assert 1e-6 * (high - low) < 2.0 * np.ptp(surface.height_m[surface.measured])
    assert "to -1 mm" in plt.gca().get_legend_handles_labels()[0][0].get_label()


def test_the_spectrum_says_where_the_contacts_are(several, plt):
    axes = several.plot.spectrum()
    width_m = several.caps.contact_diameter_m
    marks = {line.get_label(): line for line in axes.get_lines()}
    at = next(line for label, line in marks.items() if label.startswith("contacts"))
    assert at.get_xdata()[0] == pytest.approx(1e-3 / width_m)
    loaded = several.caps.load_N > 0
    load_N, wide_m = several.caps.load_N[loaded], 2 * several.caps.contact_radius_m[loaded]
    assert load_N[wide_m <= width_m].sum() >= 0.5 * load_N.sum()
    assert load_N[wide_m < width_m].sum() < 0.5 * load_N.sum()
    assert marks["along x"].get_xdata()[-1] == pytest.approx(5.0, rel=0.15)  # 1/mm, Nyquist


def test_two_faces_on_the_same_axes_have_one_unit(several, plt):
    axes = several.plot.energy()
    label, limits, n = axes.get_xlabel(), axes.get_xlim(), len(axes.get_lines())
    unit_m = several.slip.total_slip_displacement_m * 3.0 / limits[1]
    slip = several.slip

    class Scaled:  # of a face that slips a thousand times as far
        def __getattr__(self, name):
            return getattr(slip, name)

        total_slip_displacement_m = 1e3 * slip.total_slip_displacement_m
        limits_m = 1e3 * slip.limits_m

        def energy_J(self, displacement_m):
            return 1e3 * slip.energy_J(displacement_m / 1e3)

    replace(several, slip=Scaled()).plot.energy(axes)
    assert axes.get_xlabel() == label
    curve = axes.get_lines()[n].get_xdata()
    assert curve[-1] * unit_m == pytest.approx(3.0 * Scaled.total_slip_displacement_m)
    assert axes.get_xlim() == pytest.approx((limits[0], 1e3 * limits[1]))


def test_what_cannot_be_drawn_is_an_error_that_says_why_and_leaves_no_window(plt):
    with pytest.raises(OutputError, match=r"loop'; got .*; expected caps that carry"):
        output_cases.none().plot.loop()
    assert plt.get_fignums() == []


def test_tables_hold_the_columns_of_the_result(several, tmp_path):
    import h5py

    from capslip.output.tables import write_result

    write_result(several, tmp_path)
    tables = several.tables
    groups = {"caps": tables.caps, "normal": tables.normal_curve, "slip": tables.slip}
    with h5py.File(tmp_path / "result.h5") as file:
        for name, table in {**groups, "damping": tables.damping}.items():
            assert set(file[name]) == set(table.dtype.names)
            for column in table.dtype.names:
                stored = file[name][column]
                stored = stored.asstr()[()] if stored.dtype.kind == "O" else stored[()]
                np.testing.assert_array_equal(stored, table[column])
    assert list(tables.families["family"]) == ["G", "P"]
    assert list(tables.families["count"]) == [several.families.m, several.families.n]
    energy_J = several.slip.energy_at_force_J(tables.slip["force_N"])
    np.testing.assert_array_equal(tables.slip["energy_J"], energy_J)


def test_nothing_found_is_tables_without_rows():
    tables = output_cases.none().tables
    for name in ("caps", "families", "normal_curve", "slip", "damping"):
        table = getattr(tables, name)
        assert table.shape == (0,)
        assert table.dtype.names
    assert "no_caps" in tables.problems["code"]


def test_a_table_makes_a_data_frame(several):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(several.tables.caps)
    assert list(frame.columns) == list(several.tables.caps.dtype.names)
    assert frame.groupby("family")["radius_m"].mean().to_dict() == pytest.approx(
        {name: several.caps.radius_m[several.caps.family == name].mean() for name in "GP"}
    )
