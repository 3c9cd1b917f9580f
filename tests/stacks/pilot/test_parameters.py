import subprocess
import sys

import pytest

from daemon.model.sut import Observation
from daemon.stacks.pilot import PilotParameters
from daemon.stacks.pilot._parameters import read_parameters
from daemon.stacks.registry import make_sut
from grammars.model.geometry import Twist2


def test_defaults_are_taken_and_given_values_replace_them():
    parameters = read_parameters({"goal_tolerance": 0.2, "recoveries": 3})
    assert parameters == PilotParameters(goal_tolerance=0.2, recoveries=3)
    assert parameters.max_speed == PilotParameters().max_speed


def test_the_idle_system_stands_still_and_takes_no_parameters():
    decision = make_sut("idle", {}).update(Observation(0.0, (), ()))
    assert decision.command == Twist2()
    assert decision.progress.state == "active"
    with pytest.raises(ValueError, match="speed"):
        make_sut("idle", {"speed": 1.0})


def test_checking_parameters_loads_no_compiler():
    code = (
        "import sys; from daemon.stacks.registry import check_parameters; "
        "check_parameters('pilot', {});"
        "sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
