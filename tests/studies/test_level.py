"""A balanced face by caps owes nothing to the plane taken off, the cut, or the map's sides."""

import numpy as np
import pytest

from capslip.studies.level import study
from capslip.studies.level.study import (
    REACH,
    Compared,
    compared,
    faces,
    held,
    table_of_changes,
    table_of_errors,
)


def face_named(group, name):
    return next(face for face in faces(0, group) if face.name.startswith(name))


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize(
    ("group", "name"), [("caps", "caps of the paper, 460 N"), ("waves", "waves of 5 mm, 100 N")]
)
def test_no_change_of_the_frame_changes_the_answer(group, name, monkeypatch):
    """On pixels twice as wide, of which a wave still has 25."""
    monkeypatch.setattr(study, "SHAPE", (200, 300))
    monkeypatch.setattr(study, "PIXEL_M", (2e-4, 2e-4))
    rows = list(held(face_named(group, name)))
    assert len(rows) == 10
    for row in rows:
        assert row.settled, row
        assert row.counts, row
        assert row.relative.max() <= REACH[group], row
    assert table_of_changes(rows).count("| 1 | 1 |") == 10


def test_caps_agree_with_boundary_elements_that_turn_too():
    found = compared(face_named("caps", "6 caps"))
    assert abs(found.approach) < 2e-3
    assert np.median(np.abs(found.energy)) < 0.01
    assert found.contacts[0] == found.contacts[1]


def test_the_table_of_errors_counts_in_per_cent():
    one = Compared("a", "caps", 0.001, np.array([-0.05, 0.02, 0.01, 0.0]), (3, 3))
    text = table_of_errors([one])
    assert "| a | 0.10 | -5.00 | 2.00 | 1.00 | 0.00 | 3 of 3 |" in text
    assert "| caps: median | 0.10 | 5.00 | 2.00 | 1.00 | 0.00 | 1 of 1 equal |" in text
