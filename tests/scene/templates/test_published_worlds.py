"""Building C against the meshes it was simulated in."""

import pytest

from campaigns.studies.published_worlds import fits


@pytest.fixture(scope="module")
def worlds(reference_data):
    folder = reference_data / "worlds"
    if not folder.is_dir():
        pytest.skip("the published meshes are not here")
    return reference_data


def test_building_c_is_the_published_one_in_both_worlds(worlds, campaigns):
    found = fits(worlds, campaigns)
    assert {name: min(fit.shares) >= 0.97 for name, fit in found.items()} == {
        "S1": True,
        "S3.4": True,
    }
