"""Fixtures that several tests share."""

import pytest

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
