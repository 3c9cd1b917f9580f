import pytest

from daemon.model.sut import SutFailure
from tests.stacks.ros2.test_inspection import inspected


def test_a_command_that_does_not_exist_is_told_in_words():
    with pytest.raises(SutFailure, match="the stack did not come up"):
        inspected(launch="a-command-nobody-has {map}")
