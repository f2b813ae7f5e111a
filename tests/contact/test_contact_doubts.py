"""Doubts about the contact, from the state under the preload and the loads of the caps."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.caps.families import group_families
from capslip.caps.table import CapTable
from capslip.contact.doubts import contact_doubts, material_doubts
from capslip.settings import Material


def loaded_caps(load_N, contact_radius_m):
    """Caps on hills of a radius of 0.5, at random places."""
    n = len(load_N)
    every = {field.name: np.ones(n) for field in fields(CapTable)}
    places = np.random.default_rng(0).uniform(size=(3, n))
    every |= dict(zip(("x_m", "y_m", "peak_height_m"), places, strict=True))
    every |= {"peak_height_se_m": np.full(n, np.nan), "radius_m": np.full(n, 100.0)}
    every |= {"family": np.full(n, "", dtype="<U1"), "flags": np.zeros(n, np.uint16)}
    every |= {"load_N": load_N, "contact_radius_m": contact_radius_m}
    return group_families(CapTable(**every))


def severities(problems):
    return {problem.code: problem.severity for problem in problems}


def state(contacts=10, pairs=0, max_pressure_Pa=None):
    steel = SimpleNamespace(E_star_Pa=110e9)
    return SimpleNamespace(
        contacts=contacts,
        overlapping_pairs=pairs,
        max_pressure_Pa=max_pressure_Pa,
        composite=steel,
    )


@pytest.mark.parametrize(("share", "severity"), [(0.04, "info"), (0.06, "warning")])
def test_wide_contacts_matter_by_the_load_that_they_carry(share, severity):
    load_N = np.full(10, (1.0 - share) / 9.0)
    load_N[0] = share
    caps = loaded_caps(load_N, np.where(np.arange(10) == 0, 0.6, 0.4))
    found = contact_doubts(state(), *caps, 1e-4, Material(), cut_certified=False)
    assert severities(found) == {"contact_beyond_cap": severity}


def test_contacts_that_run_together_and_lean_on_few_pixels_are_doubted():
    caps = loaded_caps(np.ones(10), np.full(10, 0.4))
    assert contact_doubts(state(), *caps, 1e-4, Material(), cut_certified=False) == []
    codes = [
        p.code for p in contact_doubts(state(pairs=2), *caps, 0.3, Material(), cut_certified=False)
    ]
    assert codes == ["contacts_merge", "contact_under_resolved"]


@pytest.mark.parametrize(
    ("pressure_Pa", "yield_Pa", "code"),
    [
        (1.0e9, 500e6, "plastic"),
        (0.7e9, 500e6, None),
        (4.0e9, None, "pressure_beyond_elastic"),
        (3.0e9, None, None),
    ],
)
def test_pressures_beyond_the_material_are_doubted(pressure_Pa, yield_Pa, code):
    caps = loaded_caps(np.ones(10), np.full(10, 0.4))
    pressed = state(max_pressure_Pa=pressure_Pa)
    found = contact_doubts(
        pressed, *caps, 1e-4, Material(yield_stress_Pa=yield_Pa), cut_certified=False
    )
    assert [problem.code for problem in found] == ([] if code is None else [code])


def test_unlike_materials_and_odd_friction_are_doubted():
    assert material_doubts(Material()) == []
    odd = Material(
        youngs_modulus_Pa=(200e9, 3e9), poisson_ratio=(0.3, 0.4), friction_coefficient=2.0
    )
    assert [p.code for p in material_doubts(odd)] == ["materials_coupled", "friction_suspect"]
