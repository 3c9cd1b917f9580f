"""Kernels compiled anew, and runs of stacks that need many of them."""

import json
import os
import subprocess
import sys
from collections import Counter

import pytest

from daemon.model.verdicts import Outcome
from tests.engine.conftest import Runs

FIRST_RUN = """
import json, sys, tempfile
from pathlib import Path
from numba.core import event
from daemon.campaign import expand, load_campaign
from daemon.model.kernels import count_kernels
from daemon.run import execute, load_kernels

compiled = []

class Listener(event.Listener):
    def on_start(self, happened):
        compiled.append(happened.data["dispatcher"].py_func.__qualname__)

    def on_end(self, happened): ...

event.register("numba:compile", Listener())
submission = expand(load_campaign(sys.argv[1]))
spec = next(iter(submission.specs))
load_kernels(spec, submission.scenes[0])
before = len(compiled)
with tempfile.TemporaryDirectory() as folder:
    execute(spec, submission.scenes[0], trace_path=Path(folder) / "run.mcap")
print(json.dumps([count_kernels(), compiled[:before], compiled[before:]]))
"""


@pytest.mark.timeout(600)
def test_a_short_run_compiles_each_kernel_once_and_others_load_what_it_lists(campaigns, tmp_path):
    campaign = str(campaigns / "demo" / "campaign.yaml")
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", FIRST_RUN, campaign]
    kernels, first, late = json.loads(subprocess.check_output(command, env=environment))
    assert kernels > 20
    files = [path.name.rpartition(".")[0].rpartition(".")[0] for path in tmp_path.rglob("*.nbc")]
    assert [name for name, count in Counter(files).items() if count > 1] == []
    assert len(first) >= kernels - len(late)
    assert json.loads(subprocess.check_output(command, env=environment)) == [kernels, [], []]


def test_the_ros_stack_drives_a_robot_with_two_lasers_the_same_way_twice(campaigns, tmp_path):
    two_lasers = Runs(campaigns / "two_lasers" / "campaign.yaml")
    spec = next(
        s
        for s in two_lasers.submission.specs
        if (s.scenario, s.sut.name) == ("open-house", "shuttle-nav")
    )
    result, again = (two_lasers.execute(spec, tmp_path / f"{n}.mcap") for n in range(2))
    assert result.outcome is Outcome.PASS
    assert again.trace == result.trace
