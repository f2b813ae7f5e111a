"""Axes along which the face itself or its load changes."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from capslip.studies.limits_cases import (
    APART,
    PAPER,
    PIXEL_M,
    SHAPE,
    Axis,
    Case,
    on_faces,
    random_face,
    scattered_face,
    scene_axis,
)
from capslip.surface.heightmap import HeightMap
from capslip.surface.synthetic import Cap, CapFamily, Scene, Truth


def axes_of_faces(seed: int) -> tuple[Axis, ...]:
    """Return the axes; another seed, other faces of the same kind."""
    return (
        _small_force(seed),
        _height_difference(seed),
        _hidden_family(seed),
        _counts(seed),
        _few_caps(seed),
        _equal_caps(seed),
        _spread(seed),
        _roughness(seed),
        _merging(seed),
        _edge(seed),
        _lay(seed),
        _ridges(seed),
        _high_load(seed),
        _low_load(seed),
        _yield(seed),
        _gross_slip(seed),
        _waves(seed),
        _self_affine(seed),
    )


def _small_force(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "small force",
        (0.1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10),
        "T = {:g} mu N",
        lambda face, share: {"shares": (share,)},
    )
    return Axis("small force", "T / (mu N)", (), cases)


def _height_difference(seed: int) -> Axis:
    cases = tuple(
        Case(
            "small height difference",
            h_m,
            f"h = {h_m * 1e9:g} nm, {preload_N:g} N",
            random_face(APART * seed + 4, PAPER[0], replace(PAPER[1], below_m=h_m)),
            preload_N,
        )
        for h_m in (1.6e-7, 1e-7, 5e-8, 2e-8, 1e-8, 5e-9, 2e-9)
        for preload_N in (50.0, 460.0, 2000.0)
    )
    return Axis("small height difference", "h [m]", ("families_doubtful", "contacts_merge"), cases)


def _hidden_family(seed: int) -> Axis:
    """P-caps sink towards the cut of 10 %, and below it: the caps fill 15 % of the face."""
    cases = tuple(
        Case(
            "hidden family",
            h_m,
            f"h = {h_m * 1e9:g} nm, {preload_N:g} N",
            replace(
                random_face(APART * seed + 4, PAPER[0], replace(PAPER[1], below_m=h_m)),
                material_ratio=0.15,
            ),
            preload_N,
        )
        for h_m in (2.4e-7, 3e-7, 3.4e-7, 3.7e-7, 4e-7, 4.3e-7)
        for preload_N in (50.0, 460.0, 2000.0)
    )
    codes = ("family_below_cut", "sensitive_to_cut", "contact_reaches_below_cut")
    return Axis("hidden family", "h [m]", codes, cases)


def _counts(seed: int) -> Axis:
    counts: tuple[tuple[int, int], ...] = (
        (5, 18),
        (12, 11),
        (18, 5),
        (20, 3),
        (3, 8),
        (2, 21),
        (2, 4),
        (5, 2),
        (22, 1),
        (1, 22),
    )
    counts += ((5, 1), (1, 5), (1, 1), (23, 0))
    cases = tuple(
        Case(
            "uneven families",
            float(min(m, n)),
            f"m = {m}, n = {n}, seed {face}",
            random_face(
                face,
                CapFamily("G", m, 23.8),
                *((replace(PAPER[1], count=n, below_m=min(2e-7, 8e-7 / (m + n))),) if n else ()),
            ),
        )
        for m, n in counts
        for face in (APART * seed + 5, APART * seed + 6)
    )
    codes = ("families_doubtful", "one_contact")
    return Axis("uneven families", "smaller of m and n", codes, cases, logarithmic=False)


def _few_caps(seed: int) -> Axis:
    cases = tuple(
        Case(
            "few caps",
            float(count),
            f"{count} caps, {preload_N:g} N",
            random_face(APART * seed + 7 + count, CapFamily("G", count, 40.0)),
            preload_N,
        )
        for count in (6, 4, 3, 2, 1)
        for preload_N in (20.0, 100.0, 460.0)
    )
    return Axis("few caps", "caps", ("one_contact", "families_doubtful"), cases, logarithmic=False)


def _equal_caps(seed: int) -> Axis:
    cases = tuple(
        Case(
            "identical caps",
            noise_m,
            f"{count} caps, noise {noise_m * 1e9:g} nm",
            replace(
                random_face(APART * seed + 30 + count, CapFamily("G", count, 25.0)),
                noise_rms_m=noise_m,
            ),
        )
        for noise_m in (0.0, 0.3e-9, 1e-9, 3e-9)
        for count in (3, 5, 12, 23, 40)
    )
    return Axis("identical caps", "noise [m]", ("families_doubtful", "contacts_merge"), cases)


def _spread(seed: int) -> Axis:
    cases = tuple(
        Case(
            "spread of heights",
            spread_m,
            f"spread {spread_m * 1e9:g} nm, seed {face}",
            scattered_face(spread_m, face),
        )
        for spread_m in (2e-9, 1e-8, 1.4e-8, 1.8e-8, 2.2e-8)
        for face in range(APART * seed + 2, APART * seed + 6)
    )
    codes = ("families_doubtful", "more_than_two_families")
    return Axis("spread of heights", "spread of each family, 0.1 um apart [m]", codes, cases)


def _roughness(seed: int) -> Axis:
    levels = (0.5e-9, 1e-9, 2e-9, 5e-9, 1e-8, 2e-8, 5e-8, 1e-7)
    codes = ("shallow_saddles", "not_spherical", "sensitive_to_filter", "sensitive_to_pruning")
    return scene_axis(
        seed,
        "roughness",
        "rms [m], correlation length 1 mm",
        levels,
        "roughness {:g} m",
        (*codes, "pruning_decides", "boundary_elements_needed"),
        lambda x: {"roughness_rms_m": x, "roughness_length_m": 1e-3},
    )


def _lattice(seed: int, pairs_apart: float | None, edge: float | None) -> tuple[Cap, ...]:
    """Ten caps of 25 m, 0.2 um above the cut; some in pairs, or some at the edge.

    Distances are in radii of the disc at the cut. Other seeds than 0 shift every cap, pair by pair
    and along the edge, and change all radii.
    """
    rng = np.random.default_rng(APART * seed)

    def moved() -> float:
        return rng.uniform(-0.5e-3, 0.5e-3) if seed else 0.0

    radius_m, height_m = 25.0 * (rng.uniform(0.9, 1.1) if seed else 1.0), 0.2e-6
    disc_m = math.sqrt(2.0 * radius_m * height_m)
    if edge is not None:
        inside_m = edge * disc_m
        at = [(inside_m, 8e-3 + moved()), (inside_m, 21e-3 + moved())]
        at += [(21e-3 + moved(), inside_m), (41e-3 + moved(), inside_m)]
        for x_m, y_m in ((16e-3, 14e-3), (31e-3, 18e-3), (46e-3, 25e-3), (19e-3, 31e-3)):
            at += [(x_m + moved(), y_m + moved())]
    else:
        half_m = (pairs_apart or 0.0) * disc_m / 2.0
        at = [
            (x_m + moved(), y_m + moved())
            for x_m, y_m in ((17e-3, 9e-3), (43e-3, 10e-3), (10e-3, 28e-3), (52e-3, 30e-3))
        ]
        for x_m, y_m in ((30e-3, 16e-3), (24e-3, 32e-3), (38e-3, 34e-3)):
            x_m, y_m = x_m + moved(), y_m + moved()
            at += [
                (x_m - 0.8 * half_m, y_m - 0.6 * half_m),
                (x_m + 0.8 * half_m, y_m + 0.6 * half_m),
            ]
    return tuple(Cap(x_m, y_m, radius_m, height_m, "G") for x_m, y_m in at)


def _merging(seed: int) -> Axis:
    cases = tuple(
        Case(
            "hills that merge",
            apart,
            f"{apart:g} disc radii apart, {preload_N:g} N",
            Scene(SHAPE, PIXEL_M, caps=_lattice(seed, apart, None)),
            preload_N,
        )
        for apart in (2.2, 1.8, 1.4, 1.0, 0.7, 0.4, 0.2, 0.1)
        for preload_N in (46.0, 460.0, 2000.0)
    )
    codes: tuple[str, ...] = (
        "connected_network",
        "shallow_saddles",
        "contacts_merge",
    )
    codes += ("pruning_decides", "sensitive_to_pruning", "not_spherical")
    return Axis("hills that merge", "distance [disc radii]", codes, cases)


def _edge(seed: int) -> Axis:
    cases = tuple(
        Case(
            "hills cut by the edge",
            inside,
            f"apex {inside:g} disc radii inside, {preload_N:g} N",
            Scene(SHAPE, PIXEL_M, caps=_lattice(seed, None, inside)),
            preload_N,
        )
        for inside in (1.1, 0.8, 0.5, 0.3, 0.1, 0.0, -0.1, -0.3)
        for preload_N in (46.0, 460.0, 2000.0)
    )
    codes = ("caps_edge", "load_on_doubtful_caps", "contact_beyond_cap")
    return Axis("hills cut by the edge", "apex inside [disc radii]", codes, cases, False)


def _with_lay(surface: HeightMap, truth: Truth, rms_m: float, seed: int) -> HeightMap:
    """Add grooves of 2 mm along y, with some randomness along x."""
    rng = np.random.default_rng(APART * seed + 11)
    (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
    phase = 2.0 * np.pi * np.arange(nx) * dx_m / 2e-3 + np.cumsum(rng.normal(0.0, 0.15, nx))
    swing = 1.0 + 0.3 * np.sin(np.arange(ny)[:, None] * dy_m / 7e-3)
    lay = swing * np.sin(phase)
    return replace(surface, height_m=surface.height_m + rms_m * lay / lay.std())


def _lay(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "grinding lay",
        (0.5e-9, 2e-9, 5e-9, 1e-8, 2e-8, 5e-8, 1e-7, 3e-7),
        "lay of {:g} m",
        lambda face, rms_m: {"face_change": partial(_with_lay, rms_m=rms_m, seed=seed)},
    )
    codes: tuple[str, ...] = (
        "not_spherical",
        "caps_ridge",
        "shallow_saddles",
        "sensitive_to_pruning",
    )
    codes += ("sensitive_to_filter", "pruning_decides", "boundary_elements_needed")
    return Axis("grinding lay", "rms of grooves 2 mm apart [m]", codes, cases)


def _elongated(surface: HeightMap, truth: Truth, ratio: float, seed: int) -> HeightMap:
    """Put ellipsoids of equal Gaussian curvature in place of the spheres."""
    (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
    y_m, x_m = ((np.arange(ny) + 0.5) * dy_m)[:, None], (np.arange(nx) + 0.5) * dx_m
    height_m = np.full(surface.shape, truth.cut_height_m - 0.5e-6)
    caps = zip(truth.x_m, truth.y_m, truth.radius_m, truth.peak_height_m, strict=True)
    for number, (x0_m, y0_m, radius_m, peak_m) in enumerate(caps):
        angle = float(APART * seed + number)
        along, across = math.cos(angle), math.sin(angle)
        u_m = along * (x_m - x0_m) + across * (y_m - y0_m)
        v_m = along * (y_m - y0_m) - across * (x_m - x0_m)
        fall_m = (u_m**2 / math.sqrt(ratio) + v_m**2 * math.sqrt(ratio)) / (2.0 * radius_m)
        np.maximum(height_m, peak_m - fall_m, out=height_m)
    return replace(surface, height_m=height_m)


def _ridges(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "elongated caps",
        (1.2, 1.5, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0),
        "R1 / R2 = {:g}",
        lambda face, ratio: {"face_change": partial(_elongated, ratio=ratio, seed=seed)},
    )
    codes = ("not_spherical", "caps_ridge", "caps_edge", "shallow_saddles", "connected_network")
    return Axis("elongated caps", "ratio of principal radii", codes, cases)


def _high_load(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "high load",
        (1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6),
        "{:g} N",
        lambda face, preload_N: {"preload_N": preload_N},
    )
    codes = (
        "contacts_merge",
        "contact_beyond_cap",
        "contact_failed",
        "plastic",
        "boundary_elements_needed",
        "contact_reaches_below_cut",
        "pressure_beyond_elastic",
        "bulk_kept",
    )
    return Axis("high load", "preload [N]", codes, cases)


def _low_load(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "low load",
        (100.0, 10.0, 1.0, 0.1, 1e-3, 1e-6),
        "{:g} N",
        lambda face, preload_N: {"preload_N": preload_N},
    )
    return Axis("low load", "preload [N]", ("one_contact", "contact_under_resolved"), cases)


def _yield(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "yield",
        (0.5, 0.8, 0.95, 1.2, 2.0, 5.0, 20.0),
        "{:g} times the pressure at which it yields",
        lambda face, share: {"yield_share": share},
    )
    return Axis("yield", "pressure / (1.6 yield stress)", ("plastic",), cases)


def _gross_slip(seed: int) -> Axis:
    cases = on_faces(
        seed,
        "gross slip",
        (0.8, 0.9, 0.99, 0.999, 1.001, 1.1, 2.0),
        "T = {:g} mu N",
        lambda face, share: {"shares": (share,)},
    )
    return Axis("gross slip", "T / (mu N)", (), cases, logarithmic=False)


WAVE_CODES: tuple[str, ...] = (
    "boundary_elements_needed",
    "not_spherical",
    "sensitive_to_cut",
    "sensitive_to_pruning",
)
WAVE_CODES += ("connected_network", "shallow_saddles", "sensitive_to_filter", "caps_edge")


def _waves(seed: int) -> Axis:
    cases = tuple(
        Case(
            "wavy faces",
            length_m,
            f"waves of {length_m * 1e3:g} mm, {preload_N:g} N, seed {face}",
            Scene(SHAPE, PIXEL_M, seed=face, waviness_rms_m=0.4e-6, waviness_length_m=length_m),
            preload_N,
        )
        for length_m in (12e-3, 8e-3, 5e-3, 3e-3, 2e-3, 1e-3)
        for preload_N in (100.0, 460.0, 2000.0)
        for face in (APART * seed + 50, APART * seed + 51)
    )
    return Axis("wavy faces", "correlation length [m]", WAVE_CODES, cases)


def _self_affine(seed: int) -> Axis:
    cases = tuple(
        Case(
            "self-affine faces",
            hurst,
            f"Hurst exponent {hurst:g}, {preload_N:g} N, seed {face}",
            Scene(
                SHAPE,
                PIXEL_M,
                seed=face,
                waviness_rms_m=0.4e-6,
                waviness_length_m=3e-3,
                waviness_spectrum="power_law",
                hurst_exponent=hurst,
            ),
            preload_N,
        )
        for hurst in (2.0, 1.4, 1.0, 0.8, 0.5)
        for preload_N in (100.0, 460.0, 2000.0)
        for face in (APART * seed + 60, APART * seed + 61)
    )
    return Axis("self-affine faces", "Hurst exponent", WAVE_CODES, cases, logarithmic=False)
