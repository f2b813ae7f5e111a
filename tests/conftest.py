"""Fixtures that several tests share."""

import errno
import os
from pathlib import Path

import pytest

from capslip.contact.solvers import refinement
from scenes import SCANS

DEAR = (
    "test_problems.py",
    "test_cli_fleet.py",
    "test_limits.py",
    "test_contact_effects.py",
    "test_chart.py",
)


def pytest_collection_modifyitems(items):
    """Let the dearest files begin, so that the other core has work to the end."""
    items.sort(key=lambda item: DEAR.index(item.path.name) if item.path.name in DEAR else len(DEAR))


@pytest.fixture
def scans():
    if not SCANS.is_dir():
        pytest.skip("the folder of real scans is not beside the project")
    return SCANS


@pytest.fixture
def fewer_points(monkeypatch):
    """Refine contacts to half as many points across, a quarter in all.

    For truths that hold on any points: of two ways to one state, both of which are solved on them.
    """
    monkeypatch.setattr(refinement, "_WIDE", 0.5 * refinement._WIDE)


@pytest.fixture
def half_written(monkeypatch):
    """Return a function that lets a method of paths write half of it, and find the disk full."""

    def only_half(method):
        whole = getattr(Path, method)

        def half(path, content, *given, **named):
            whole(path, content[: len(content) // 2], *given, **named)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(Path, method, half)

    return only_half
