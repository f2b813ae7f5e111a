"""Analyses that the tests of the output share, each computed once."""

from dataclasses import replace
from functools import cache

import numpy as np

from capslip.analysis import analyze
from capslip.output.figures import FIGURES, write_figure
from capslip.output.tables import write_result, write_summary
from capslip.settings import load_settings
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

# One cap carries no plane that turns, so these faces are pressed as they lie
SETTINGS = load_settings(
    overrides=(
        *("contact.preload_N=150", "contact.model=caps", "contact.alignment=as_levelled"),
        *("conditioning.form=none", "run.sensitivity=true"),
    )
)


@cache
def none():
    """White noise: every region above the cut is rejected."""
    height_m = np.random.default_rng(3).normal(0.0, 1e-7, (60, 90))
    analysis = analyze(HeightMap(height_m, (1e-4, 1e-4)), SETTINGS)
    assert len(analysis.caps) == 0
    return analysis


@cache
def one():
    """One cap in the middle."""
    analysis = analyze(caps_map([(15e-3, 10e-3, 10.0, 0.0)]), SETTINGS)
    assert len(analysis.caps) == 1
    return analysis


@cache
def several():
    """Two high and three low caps, some points non-measured."""
    high = [(6e-3, 5e-3, 10.0, 0.0), (22e-3, 13e-3, 10.0, 0.01e-6)]
    low = [(14e-3, 6e-3, 8.0, -0.2e-6), (24e-3, 5e-3, 8.0, -0.21e-6), (8e-3, 15e-3, 8.0, -0.19e-6)]
    surface = caps_map(high + low)
    height_m = surface.height_m.copy()
    height_m[180:, :40] = np.nan
    analysis = analyze(HeightMap(height_m, surface.pixel_size_m), SETTINGS)
    assert (analysis.families.m, analysis.families.n) == (2, 3)
    return analysis


@cache
def pressed_map():
    """Coarse pixels of the same face, pressed as a map, which resolves no small slip."""
    overrides = (
        *("contact.preload_N=150", "contact.model=boundary_elements", "conditioning.form=none"),
        *("contact.alignment=as_levelled", "run.sensitivity=false"),
    )
    return analyze(coarse(several().surface, 4), load_settings(overrides=overrides))


def coarse(surface, step):
    """Every so many rows and columns of a face."""
    dy_m, dx_m = surface.pixel_size_m
    return HeightMap(surface.height_m[::step, ::step], (step * dy_m, step * dx_m))


@cache
def two_faces():
    """Coarse pixels of the same face, and on it one with a large hill opposite a valley."""
    shape, size_m = (50, 75), (4e-4, 4e-4)
    first = HeightMap(several().surface.height_m[::4, ::4], size_m)
    second = caps_map([(14e-3, 10e-3, 6.0, 0.3e-6)], shape, size_m)
    overrides = ("contact.preload_N=150", "contact.model=caps", "conditioning.form=none")
    return analyze(first, load_settings(overrides=overrides), mate=second)


def written(analysis, folder):
    """Write what a picture reads of an analysis; return where."""
    write_result(analysis, folder)
    write_summary(analysis.summary(), folder)
    return folder


def write_figures(analysis, folder):
    """Write every figure that the analysis has data for; return their files."""
    paths = [write_figure(name, analysis, folder) for name in FIGURES]
    return [path for path in paths if path is not None]


def touching(view, every):
    """Return a view of a face of which every n-th pixel touches, at one height."""
    (ny, nx), (dy_m, dx_m) = view.shape, view.pixel_size_m
    pixel = np.arange(0, ny * nx, every)
    row, col = np.divmod(pixel, nx)
    flat_m = np.full(len(pixel), view.limits_m[1])
    place_m = np.stack([(col + 0.5) * dx_m, (row + 0.5) * dy_m, flat_m], axis=1)
    none = np.zeros(len(pixel))
    zones = replace(view.zones, pixel=pixel, pixel_contact=none.astype(int), pixel_reach=none)
    return replace(view, zones=zones, pixel_m=place_m)
