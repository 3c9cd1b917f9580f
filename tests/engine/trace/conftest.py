import pytest

from tests.engine.trace.recordings import record


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """A complete trace of twelve seconds: one full chunk of each kind and a short one."""
    path = tmp_path_factory.mktemp("trace") / "run.mcap"
    record(path)
    return path
