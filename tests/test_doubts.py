"""Doubts: what they should see is seen, and chance alone rarely raises one."""

from dataclasses import fields, replace

import numpy as np
import pytest

from capslip.caps.families import group_families
from capslip.caps.table import CapFlag, CapTable
from capslip.doubts import doubts_of_contact
from capslip.settings import Settings
from capslip.structure.response import Damping


def caps_at(x_m, y_m, peak_height_m):
    n = len(x_m)
    every = {field.name: np.ones(n) for field in fields(CapTable)}
    every |= {"x_m": x_m, "y_m": y_m, "peak_height_m": peak_height_m}
    every["peak_height_se_m"] = np.full(n, np.nan)
    every["family"] = np.full(n, "", dtype="<U1")
    every["flags"] = np.zeros(n, np.uint16)
    return CapTable(**every)


@pytest.mark.parametrize(("share", "severity"), [(0.04, "info"), (0.06, "warning")])
def test_wide_contacts_matter_by_the_load_that_they_carry(share, severity):
    caps = caps_at(*np.random.default_rng(0).uniform(size=(3, 10)))
    caps, families = group_families(caps)
    load_N = np.full(10, (1.0 - share) / 9.0)
    load_N[0] = share
    caps = replace(
        caps,
        load_N=load_N,
        contact_radius_m=np.where(np.arange(10) == 0, 0.6, 0.4),  # the hills have a radius of 0.5
        radius_m=np.full(10, 100.0),
        flags=np.full(10, CapFlag(0), dtype=np.uint16),
    )
    empty = np.zeros(1)
    damping = Damping(**{field.name: empty for field in fields(Damping)})
    damping = replace(damping, peak_loss_factor=0.0, peak_at_gross_slip=False)
    found = doubts_of_contact(caps, families, 10, 0, None, 1e-4, damping, Settings())
    assert {problem.code: problem.severity for problem in found} == {"contact_beyond_cap": severity}
