"""A fit is one file in a folder: its name, its function, and what other stages must know of it."""

import subprocess
import sys

import numpy as np
import pytest

import capslip
from capslip import registry
from capslip.caps import fits
from capslip.caps.fit import fit_caps
from capslip.caps.fitting import fit_named
from capslip.caps.hills import find_hills
from capslip.errors import SettingsError
from scenes import caps_map

CAPS = [(6e-3, 5e-3, 24.0, 0.0), (14e-3, 12e-3, 27.0, -1e-7), (24e-3, 8e-3, 25.0, -5e-8)]
TOY = '''
"""Spheres of 7 m at the highest points."""

from dataclasses import replace

import numpy as np

from capslip.caps.fitting import Fit
from capslip.caps.spheres import spheres_by_volume


def spheres(given):
    found = spheres_by_volume(given)
    return replace(found, radius_m=np.full(len(found.x_m), {radius_m}))


FIT = Fit(spheres, label="seven", colour="#000000", marker="x", {options})
'''


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """Put a new fit, one file, into the folder of fits."""

    def make(radius_m, options=""):
        (tmp_path / "toy.py").write_text(TOY.format(radius_m=radius_m, options=options))
        monkeypatch.setattr(fits, "__path__", [*fits.__path__, str(tmp_path)])
        return ("caps.fit=toy",)

    yield make
    sys.modules.pop("capslip.caps.fits.toy", None)
    vars(fits).pop("toy", None)


@pytest.mark.long
def test_a_new_fit_is_one_file(toy):
    settings = capslip.load_settings(overrides=toy(7.0))
    assert "toy" in registry.names("caps.fits")
    analysis = capslip.analyze(caps_map(CAPS), settings)
    assert analysis.caps.radius_m == pytest.approx(7.0)
    assert analysis.contact is not None
    assert analysis.summary()["families"]["G"]["radius_m"] == pytest.approx(7.0)


@pytest.mark.parametrize("share", [None, 0.3])
def test_a_fit_is_pressed_again_where_it_says_so(toy, share):
    """It is then fitted at its share of the compression a^2 / R that contact found.

    Of hills of 25 m: left to choose, the contact would press the map, as they touch far beside.
    """
    chosen = ("contact.preload_N=5.0", "contact.model=interacting")
    overrides = (*toy(7.0, f"compression_share={share}"), *chosen)
    caps = capslip.analyze(caps_map(CAPS), capslip.load_settings(None, overrides)).caps
    loaded = caps.load_N > 0.0
    assert loaded.any()
    if share is None:
        assert caps.fit_depth_m == pytest.approx(0.5 * caps.cap_height_m)
    else:
        depth_m = share * caps.contact_radius_m**2 / caps.radius_m
        assert caps.fit_depth_m[loaded] == pytest.approx(depth_m[loaded], rel=0.02)


@pytest.mark.long
def test_a_fit_takes_its_own_share_of_the_height(toy):
    overrides = toy(7.0, "depth_share=0.8")
    caps = capslip.analyze(caps_map(CAPS), capslip.load_settings(None, overrides)).caps
    assert caps.fit_depth_m == pytest.approx(0.8 * caps.cap_height_m)


def test_a_fit_that_knows_the_cut_alone_takes_no_other_depth():
    surface = caps_map(CAPS)
    hills = find_hills(surface)
    assert fit_named("equation18").at_cut_alone
    asked = fit_caps(surface, hills, "equation18", np.full(3, 1e-8))
    assert asked.fit_depth_m == pytest.approx(asked.cap_height_m, rel=2e-3)  # crown above the cut
    free = fit_caps(surface, hills, "equation18")
    for name, column in asked.columns().items():
        assert np.array_equal(column, free.columns()[name], equal_nan=column.dtype.kind == "f")


def test_a_misspelt_fit_is_refused_with_what_there_is():
    expected = (
        r"settings: caps.fit: got 'pined'; expected one of contact, equation18, least_squares, "
        r"pinned; did you mean pinned\?"
    )
    with pytest.raises(SettingsError, match=expected):
        capslip.load_settings(overrides=("caps.fit=pined",))


def test_every_fit_tells_what_figures_draw():
    found = [fit_named(name) for name in registry.names("caps.fits")]
    for names in zip(*((fit.label, fit.colour, fit.marker) for fit in found), strict=True):
        assert len(set(names)) == len(found)


def test_the_names_load_no_fit():
    code = (
        "import sys, capslip.settings as s; s.load_settings(); "
        "sys.exit(any(name.startswith('capslip.caps.fits.') or name == 'numpy' "
        "for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
