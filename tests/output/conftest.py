"""The analyses of `output_cases` as fixtures."""

import output_cases
import pytest


@pytest.fixture(scope="session")
def none():
    return output_cases.none()


@pytest.fixture(scope="session")
def one():
    return output_cases.one()


@pytest.fixture(scope="session")
def several():
    return output_cases.several()
