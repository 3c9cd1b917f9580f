import pytest

from tests.stacks.ros2.pretended_link import Machine


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Let every stack that is started be the one that a test has put there."""
    return Machine(tmp_path, monkeypatch)
