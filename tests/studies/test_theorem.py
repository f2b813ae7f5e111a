"""The study of the theorem's error on faces where its sign is known."""

import numpy as np
import pytest

from capslip.studies.theorem import errors as theorem


def test_a_sphere_has_no_direction_and_next_to_no_error():
    along_x, along_y = (
        row
        for row in theorem.theorem_errors(theorem.paraboloid(1.0, 48), 20.0)
        if row.poisson_ratio == 0.3 and not row.given
    )
    assert np.allclose(along_x.all, along_y.all, atol=1e-5)
    assert abs(along_x.stiffness) < 1e-3
    assert np.abs(along_x.displacement).max() < 1e-3
    assert np.abs(along_x.energy).max() < 0.01


def test_an_elongated_contact_is_softer_along_its_length(monkeypatch):
    monkeypatch.setattr(theorem, "POISSON_RATIOS", (0.0, 0.3))
    found = list(theorem.theorem_errors(theorem.paraboloid(3.0, 48), 20.0))
    for exact in found[:4]:
        assert np.abs(exact.all).max() < 1e-5
    along, across = (row for row in found[4:] if not row.given)
    assert (along.displacement < -0.02).all()
    assert (across.displacement > 0.02).all()
    assert along.stiffness == pytest.approx(-along.displacement[0], rel=0.1)
    for given in (row for row in found[4:] if row.given):
        assert np.abs([given.stiffness, *given.displacement]).max() < 2e-3
        assert np.abs(given.energy[1:]).max() < 0.01  # at 0.1 few pixels slip
    assert "nan" not in theorem.table(found)
