"""What the pictures in three dimensions show, without a window."""

import json
import shutil
from dataclasses import replace

import h5py
import numpy as np
import output_cases
import pytest

from capslip.errors import OutputError
from capslip.output.mesh import segment_mesh
from capslip.output.tables import write_result, write_summary
from capslip.output.view import (
    COLOURS,
    cap_at,
    cap_lines,
    cap_profiles,
    check_result,
    colouring,
    read_view,
    round_limits,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("result")
    analysis = output_cases.several()
    write_result(analysis, folder)
    write_summary(analysis.summary(), folder)
    return folder


@pytest.fixture(scope="module")
def view(folder):
    return read_view(folder)


def test_view_holds_the_result(view, several):
    surface = several.conditioned.surface
    assert view.shape == surface.shape
    np.testing.assert_allclose(view.height_m, surface.height_m, rtol=1e-6, atol=1e-13)
    assert view.pixel_size_m == pytest.approx(surface.pixel_size_m)
    assert list(view.columns["family"]) == list(several.caps.family)
    np.testing.assert_array_equal(view.columns["diameter_m"], several.caps.diameter_m)
    np.testing.assert_allclose(view.cap_load_N, several.caps.load_N)
    assert view.cap_loss_share.sum() == pytest.approx(1.0)
    assert view.force_share == pytest.approx(0.25)
    full_m = several.contact.approach_m - several.contact.bulk_m
    assert view.approach_at(1.0) == pytest.approx(full_m)
    assert view.approach_at(0.0) == 0.0


def test_cap_without_a_sphere_is_left_out(several, tmp_path):
    radius_m = several.caps.radius_m.copy()
    radius_m[1] = np.nan
    write_result(replace(several, caps=several.caps.with_columns(radius_m=radius_m)), tmp_path)
    view = read_view(tmp_path)
    assert list(view.cap) == [0, 2, 3, 4]
    np.testing.assert_allclose(view.cap_load_N, several.caps.load_N[view.cap])


def test_large_map_is_thinned_on_the_way_and_keeps_its_edges(folder, view, monkeypatch):
    monkeypatch.setattr("capslip.output.view.BLOCK", 1000)  # many blocks
    thin = read_view(folder, max_cells=2000)
    assert thin.height_m.size < 4000
    rows = np.searchsorted(view.y_m, thin.y_m - 1e-9)
    cols = np.searchsorted(view.x_m, thin.x_m - 1e-9)
    np.testing.assert_array_equal(thin.height_m, view.height_m[np.ix_(rows, cols)])
    assert (rows[0], rows[-1]) == (0, view.shape[0] - 1)
    assert thin.side_m == view.side_m


def test_two_faces_are_parts_of_their_sum(view, tmp_path):
    both = output_cases.two_faces()
    pair = read_view(output_cases.written(both, tmp_path))
    known = np.isfinite(pair.height_m)
    np.testing.assert_array_equal(known, np.isfinite(both.conditioned.second_m))
    np.testing.assert_allclose(pair.second_m[known], both.conditioned.second_m[known], rtol=1e-6)
    assert np.isfinite(pair.second_m).all()
    np.testing.assert_allclose(pair.first_m + pair.second_m, pair.height_m, rtol=1e-6, atol=1e-12)
    x_m, y_m = np.meshgrid(pair.x_m, pair.y_m)
    np.testing.assert_allclose(pair.second_at(x_m, y_m), pair.second_m, atol=1e-15)
    between_m = 0.5 * (pair.second_m[20, 30] + pair.second_m[20, 31])
    at = np.array([0.5 * (pair.x_m[30] + pair.x_m[31])]), pair.y_m[[20]]
    assert pair.second_at(*at)[0] == pytest.approx(between_m)
    first_m = pair.first_m[known]
    assert first_m.min() <= pair.first_limits_m[0] < pair.first_limits_m[1]
    assert pair.first_limits_m != pair.limits_m
    assert view.second_m is None
    np.testing.assert_array_equal(view.first_m, view.height_m)
    assert view.first_limits_m == view.limits_m
    assert not view.second_at(x_m, y_m).any()


@pytest.mark.parametrize("by", COLOURS)
def test_every_colour_has_a_value_a_cap(view, by):
    colours = colouring(view, by)
    assert colours.value.shape == view.cap.shape
    assert np.isfinite(colours.value).all()
    if colours.names:
        assert set(colours.value) == set(range(len(colours.names)))
    else:
        assert colours.limits[1] >= colours.value.max() > colours.limits[0]


def test_single_family_is_not_called_high_or_low(view):
    columns = {**view.columns, "family": np.array(["G"] * 4 + [""], dtype=object)}
    names = [name for name, _ in colouring(replace(view, columns=columns), "family").names]
    assert names == ["one family (4)", "no family (1)"]
    columns["family"] = np.array(["G"] * 5, dtype=object)
    names = [name for name, _ in colouring(replace(view, columns=columns), "family").names]
    assert names == ["caps (5)"]


def test_spikes_do_not_eat_the_range_and_its_ends_are_round():
    values = np.append(np.random.default_rng(101).uniform(-0.0174, 0.31, 10_000), [50.0, -80.0])
    assert round_limits(values) == (-0.05, 0.35)
    assert round_limits(np.full(5, 3.0))[1] > 3.0
    assert round_limits(np.full(3, np.nan)) == (0.0, 1.0)


def test_place_finds_its_cap_and_says_what_is_known_of_it(view, several):
    caps = several.caps
    assert cap_at(view, caps.x_m[2], caps.y_m[2] + 0.3 * caps.diameter_m[2]) == 2
    assert cap_at(view, 0.0, 0.0) is None
    text = "\n".join(cap_lines(view, 0, 1.0, 0.5))
    assert "cap 1, family G" in text
    assert "of the loss" in text
    assert "slips in part" in text
    assert "touches nowhere" not in text


def test_profile_is_the_row_of_the_map_with_the_sphere(view, several):
    s_m, height_m, sphere_m = next(cap_profiles(view, [0]))
    caps, surface = several.caps, several.conditioned.surface
    row = int(caps.y_m[0] // surface.pixel_size_m[0])
    cols = np.rint((s_m + caps.x_m[0]) / surface.pixel_size_m[1] - 0.5).astype(int)
    np.testing.assert_allclose(height_m, surface.height_m[row, cols], rtol=1e-6, atol=1e-13)
    near = np.abs(s_m) < 0.3 * caps.diameter_m[0]
    np.testing.assert_allclose(sphere_m[near], height_m[near], atol=1e-8)


def test_rings_lie_on_their_spheres_and_end_at_the_edge_of_the_face():
    apex_m = np.array([[0.1e-3, 5e-3, 1e-6], [9e-3, 9.5e-3, 2e-6]])
    R, outer_m = np.array([2.0, 3.0]), np.array([1e-3, 2e-3])
    points, cells, ring = segment_mesh(apex_m, R, 0.25 * outer_m, outer_m, (10e-3, 10e-3))
    assert (points[:, :2] >= -1e-15).all()
    assert (points[:, :2] <= 10e-3 + 1e-15).all()
    dx, dy, dz = (points - apex_m[ring]).T
    np.testing.assert_allclose(dx**2 + dy**2, -dz * (2 * R[ring] + dz), rtol=1e-6, atol=1e-18)
    assert (ring[cells] == ring[cells[:, :1]]).all()
    a, b, c = (points[cells[:, i]] for i in range(3))
    assert np.cross(b - a, c - a)[:, 2].min() >= -1e-20  # all look up


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nothing.h5", "no such file"),
        ("text.h5", "no HDF5 file"),
        ("scan.h5", "no result of an analysis"),
    ],
)
def test_wrong_file_is_one_clear_line(tmp_path, name, said):
    (tmp_path / "text.h5").write_text("heights")
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        file["height"] = np.zeros((3, 3))
    with pytest.raises(OutputError, match=said) as caught:
        read_view(tmp_path / name)
    assert "capslip analyze SCAN --out FOLDER" in str(caught.value)


@pytest.mark.parametrize("text", ["{", "[]", ""])
@pytest.mark.parametrize("reads", [read_view, check_result])
def test_a_damaged_summary_is_one_clear_line(folder, tmp_path, reads, text):
    shutil.copy(folder / "result.h5", tmp_path)
    reads(tmp_path)
    (tmp_path / "summary.json").write_text(text)
    with pytest.raises(OutputError, match=r"summary\.json: damaged; .*analyse again"):
        reads(tmp_path)


def test_report_beside_the_result_is_as_good(folder, view):
    (folder / "report.html").write_text("<html></html>")
    assert read_view(folder / "report.html").path == view.path
    assert json.loads((folder / "summary.json").read_text())["name"] == view.name


def test_contact_points_are_drawn_as_large_as_they_are_unless_none_would_be_seen(tmp_path):
    analysis = output_cases.pressed_map()
    write_result(analysis, tmp_path)
    write_summary(analysis.summary(), tmp_path)
    view = read_view(tmp_path)
    pixel_m2, face_m2 = np.prod(view.pixel_size_m), np.prod(view.side_m)
    for n in (1, 30, 1000, int(0.3 * face_m2 / pixel_m2)):
        several = replace(view, pixel_m=np.zeros((n, 3)))
        drawn_m2 = several.point_side_m**2
        assert drawn_m2 >= 0.999 * pixel_m2
        assert n * drawn_m2 <= 1.001 * max(n * pixel_m2, 0.02 * face_m2)
        assert several.point_side_m <= 1.001 * max(pixel_m2**0.5, max(view.side_m) / 200)
        assert bool(several.enlarged_points) == (drawn_m2 >= 1.5 * pixel_m2)
    assert several.enlarged_points == ""  # of a face of which much touches
    assert replace(view, zones=None).enlarged_points == ""
