"""Fixtures that several tests of the command line share."""

import pytest
from batch_cases import in_this_process


@pytest.fixture
def here():
    """Analyse the scans of a batch in this process."""
    with in_this_process():
        yield
