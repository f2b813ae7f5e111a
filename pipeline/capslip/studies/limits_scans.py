"""Axes along which the scan, its reading or its conditioning go wrong."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from capslip.studies.limits_cases import (
    APART,
    Axis,
    Case,
    harmless_faces,
    on_faces,
    scene_axis,
)
from capslip.surface.heightmap import HeightMap
from capslip.surface.synthetic import Scene, Truth


def axes_of_scans(seed: int) -> tuple[Axis, ...]:
    """Return the axes; another seed, other faces of the same kind."""
    return (
        _noise(seed),
        _tilt(seed),
        _bow(seed),
        _cylinder(seed),
        _patches(seed),
        _missing(seed),
        _clipping(seed),
        _steps(seed),
        _few_pixels(seed),
        _many_pixels(seed),
        _low_cut(seed),
        _high_cut(seed),
        _pixel_shape(seed),
        _height_units(seed),
        _pixel_units(seed),
        _both_units(seed),
        _spikes(seed),
        _dust(seed),
    )


def _noise(seed: int) -> Axis:
    levels = (0.5e-9, 2e-9, 5e-9, 1e-8, 2e-8, 5e-8, 1e-7, 2e-7)
    codes = ("caps_noisy_apex", "load_on_doubtful_caps", "sensitive_to_filter")
    return scene_axis(
        seed, "noise", "rms [m]", levels, "noise {:g} m", codes, lambda x: {"noise_rms_m": x}
    )


FORM_CODES = (
    "tilt_left",
    "bow_left",
    "one_contact",
    "caps_edge",
    "connected_network",
    "sensitive_to_cut",
)


def _tilt(seed: int) -> Axis:
    levels = (1e-8, 1e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 1e-3)
    return scene_axis(
        seed,
        "tilt left in",
        "slope",
        levels,
        "slope {:g}",
        FORM_CODES,
        lambda x: {"tilt": (x, -0.5 * x)},
        ("conditioning.form=none",),
    )


def _bow(seed: int) -> Axis:
    levels = (1e-9, 1e-8, 3e-8, 1e-7, 2e-7, 5e-7, 1e-6, 1e-5)
    return scene_axis(
        seed,
        "bow left in",
        "rise over the middle [m]",
        levels,
        "bow {:g} m",
        FORM_CODES,
        lambda x: {"bow_m": (0.5 * x, x)},
    )


def _cylinder(seed: int) -> Axis:
    levels = (1e6, 1e5, 1e4, 3e3, 1e3, 100.0, 1.0)
    return scene_axis(
        seed,
        "cylinder left in",
        "radius [m]",
        levels,
        "cylinder {:g} m",
        FORM_CODES,
        lambda x: {"cylinder_radius_m": x},
    )


def _patches(seed: int) -> Axis:
    levels = (2e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3, 8e-3)
    codes = ("hole_may_hide_hills", "caps_non_measured", "load_on_doubtful_caps")
    return scene_axis(
        seed,
        "non-measured patches",
        "radius of 12 patches [m]",
        levels,
        "patches of {:g} m",
        codes,
        lambda x: {"n_patches": 12, "patch_radius_m": x},
    )


def _missing(seed: int) -> Axis:
    levels = (0.01, 0.05, 0.2, 0.5, 0.8, 0.9, 0.95, 0.98, 0.995)
    codes = ("caps_non_measured", "load_on_doubtful_caps", "no_caps")
    return scene_axis(
        seed,
        "scattered missing points",
        "share",
        levels,
        "{:.1%} missing",
        codes,
        lambda x: {"non_measured_fraction": x},
    )


def _clipped(surface: HeightMap, truth: Truth, share: float) -> HeightMap:
    top_m = truth.peak_height_m.max()
    limit_m = top_m - share * (top_m - truth.cut_height_m)
    return replace(surface, height_m=np.minimum(surface.height_m, limit_m))


def _clipping(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "clipped sensor",
        (0.001, 0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 0.95),
        "highest {:.1%} clipped",
        lambda face, share: {"scan_change": partial(_clipped, share=share)},
    )
    codes = ("caps_plateau", "clipped")
    return Axis("clipped sensor", "share of the highest cap", codes, cases)


def _quantised(surface: HeightMap, truth: Truth, step_m: float) -> HeightMap:
    return replace(surface, height_m=np.round(surface.height_m / step_m) * step_m)


def _steps(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "quantised heights",
        (0.1e-9, 1e-9, 5e-9, 1e-8, 2e-8, 5e-8, 1e-7, 3e-7),
        "steps of {:g} m",
        lambda face, step_m: {"scan_change": partial(_quantised, step_m=step_m)},
    )
    codes = ("caps_plateau", "plateau_at_cut")
    return Axis("quantised heights", "step [m]", codes, cases)


def _few_pixels(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "few pixels",
        (1200.0, 300.0, 150.0, 75.0, 45.0, 30.0, 24.0, 18.0, 12.0),
        "{:g} points along the face",
        lambda face, nx: {"scene": _with_points(face, int(nx))},
    )
    codes = (
        "contact_under_resolved",
        "caps_few_points",
        "no_caps",
        "caps_apex_off_surface",
    )
    return Axis("few pixels", "points along the longer side", codes, cases)


def _many_pixels(seed: int) -> Axis:
    faces = harmless_faces(seed)
    cases = tuple(
        Case(
            "many pixels",
            float(nx),
            f"{nx} points along the face, {name}",
            _with_points(faces[name][0], nx),
            faces[name][1],
        )
        for nx, name in (
            (600, "smaller caps"),
            (2400, "caps of some spread"),
            (4800, "caps of the paper"),
        )
    )
    return Axis("many pixels", "points along the longer side", (), cases)


def _with_points(face: Scene, nx: int) -> Scene:
    return replace(face, shape=(2 * nx // 3, nx), pixel_size_m=(60e-3 / nx, 60e-3 / nx))


def _cut(seed: int, name: str, ratios: tuple[float, ...]) -> Axis:
    cases = on_faces(
        seed,
        name,
        ratios,
        "cut at {:.1%}",
        lambda face, ratio: {"overrides": (f"hills.material_ratio={ratio!r}",)},
    )
    codes = (
        "family_below_cut",
        "sensitive_to_cut",
        "caps_few_points",
        "plateau_at_cut",
        "no_caps",
        "contact_reaches_below_cut",
    )
    return Axis(name, "material ratio", codes, cases)


def _low_cut(seed: int) -> Axis:
    return _cut(seed, "low share kept", (0.08, 0.06, 0.04, 0.02, 0.01, 0.005, 0.002))


def _high_cut(seed: int) -> Axis:
    return _cut(seed, "high share kept", (0.12, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6))


def _pixel_shape(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "non-square pixels",
        (1.2, 2.0, 1 / 2.0, 4.0, 1 / 4.0, 8.0, 1 / 8.0, 16.0, 1 / 16.0, 64.0),
        "dy / dx = {:.3g}",
        lambda face, ratio: {"scene": _with_pixel_ratio(face, ratio)},
    )
    return Axis(
        "non-square pixels", "dy / dx", ("non_square_pixels", "contact_under_resolved"), cases
    )


def _with_pixel_ratio(face: Scene, ratio: float) -> Scene:
    dy_m, dx_m = 2e-4 * math.sqrt(ratio), 2e-4 / math.sqrt(ratio)
    shape = (round(40e-3 / dy_m), round(60e-3 / dx_m))
    return replace(face, shape=shape, pixel_size_m=(40e-3 / shape[0], 60e-3 / shape[1]))


def _misread(surface: HeightMap, truth: Truth, up: float, along: float) -> HeightMap:
    dy_m, dx_m = surface.pixel_size_m
    return replace(
        surface, height_m=up * surface.height_m, pixel_size_m=(along * dy_m, along * dx_m)
    )


def _units(
    seed: int, name: str, quantity: str, up: bool, along: bool, factors: tuple[float, ...]
) -> Axis:
    cases = on_faces(
        seed,
        name,
        factors,
        "times {:.3g}",
        lambda face, factor: {
            "scan_change": partial(
                _misread, up=factor if up else 1.0, along=factor if along else 1.0
            )
        },
    )
    codes: tuple[str, ...] = (
        "slope_suspect",
        "scale_suspect",
        "pressure_beyond_elastic",
        "plastic",
        "contact_beyond_cap",
    )
    codes += ("contact_reaches_below_cut", "contact_under_resolved")
    return Axis(name, quantity, (*codes, "contacts_merge", "one_contact", "contact_failed"), cases)


def _height_units(seed: int) -> Axis:
    factors = (25.4, 1 / 25.4, 1e3, 1e-3, 1e6, 1e-6, 1e9)
    return _units(seed, "heights in a wrong unit", "factor", True, False, factors)


def _pixel_units(seed: int) -> Axis:
    factors = (25.4, 1 / 25.4, 1e3, 1e-3, 1e6, 1e-6)
    return _units(seed, "pixels in a wrong unit", "factor", False, True, factors)


def _both_units(seed: int) -> Axis:
    factors = (25.4, 1 / 25.4, 1e3, 1e-3, 1e6, 1e-6)
    return _units(seed, "heights and pixels in a wrong unit", "factor", True, True, factors)


def _spikes(seed: int) -> Axis:
    cases = tuple(
        Case(
            "spikes",
            spike_m * number,
            f"{number} spikes of {spike_m * 1e6:g} um, {name}",
            replace(face, n_spikes=number, spike_m=spike_m),
            preload_N,
        )
        for number in (1, 20, 600, 3000)
        for spike_m in (0.1e-6, 1e-6, 1e-4)
        for name, (face, preload_N) in harmless_faces(seed).items()
    )
    codes = (
        "outliers",
        "outliers_removed",
        "spikes",
        "highest_point_on_no_cap",
        "caps_outlier",
        "caps_apex_off_surface",
    )
    return Axis("spikes", "number times height [m]", codes, cases)


def _dusty(surface: HeightMap, truth: Truth, width: int, seed: int) -> HeightMap:
    """Put three square grains of 0.5 um on the face."""
    rng = np.random.default_rng(APART * seed + 5)
    height_m = surface.height_m.copy()
    ny, nx = surface.shape
    for _ in range(3):
        row, col = rng.integers(0, ny - width), rng.integers(0, nx - width)
        height_m[row : row + width, col : col + width] += 0.5e-6
    return replace(surface, height_m=height_m)


def _dust(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "dust",
        (1.0, 2.0, 3.0, 4.0, 6.0, 10.0),
        "grains of {:g} pixels",
        lambda face, width: {"scan_change": partial(_dusty, width=int(width), seed=seed)},
    )
    codes: tuple[str, ...] = (
        "outliers",
        "outliers_removed",
        "spikes",
        "highest_point_on_no_cap",
        "one_contact",
    )
    codes += ("not_spherical", "load_on_doubtful_caps", "caps_plateau", "caps_outlier")
    return Axis("dust", "width of three grains [pixels]", codes, cases)
