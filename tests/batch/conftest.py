import pytest

from daemon.batch.paths import StatePaths


@pytest.fixture
def places(tmp_path):
    """An empty state directory."""
    places = StatePaths(tmp_path / "state")
    places.make_folders()
    return places
