"""Fixtures that several tests share."""

import pytest

from scenes import SCANS


@pytest.fixture
def scans():
    if not SCANS.is_dir():
        pytest.skip("the folder of real scans is not beside the project")
    return SCANS
