"""Fixtures that several tests of contact share."""

import pytest

from capslip.contact.solvers import refinement


@pytest.fixture
def fewer_points(monkeypatch):
    """Refine contacts to half as many points across, a quarter in all.

    For truths that hold on any points: of two ways to one state, both of which are solved on them.
    """
    monkeypatch.setattr(refinement, "_WIDE", 0.5 * refinement._WIDE)
