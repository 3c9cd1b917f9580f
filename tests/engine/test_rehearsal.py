"""The short run that compiles what a system calls, and the list by which others load it."""

import json
import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.rehearsal import kernel_list, short_run
from daemon.model.spec import SutReference

DEMO = Path(__file__).parents[2] / "campaigns" / "demo" / "campaign.yaml"

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


@pytest.fixture(scope="module")
def demo():
    return next(iter(expand(load_campaign(DEMO)).specs))


@pytest.mark.timeout(600)
def test_a_short_run_compiles_each_kernel_once_and_others_load_what_it_lists(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", FIRST_RUN, str(DEMO)]
    kernels, first, late = json.loads(subprocess.check_output(command, env=environment))
    assert kernels > 20
    files = [path.name.rpartition(".")[0].rpartition(".")[0] for path in tmp_path.rglob("*.nbc")]
    assert [name for name, count in Counter(files).items() if count > 1] == []
    assert len(first) >= kernels - len(late)
    assert json.loads(subprocess.check_output(command, env=environment)) == [kernels, [], []]


def test_numbers_choose_no_kernel_and_words_do(demo):
    def name(**changes):
        return kernel_list(replace(demo, sut=SutReference("x", "pilot", changes)))

    assert name(max_speed=0.4) == name(max_speed=0.5)
    assert name(planner="a") != name(planner="b")
    assert name(max_speed=0.4) != name()
    omnidirectional = replace(demo.robot.drive, kind="omnidirectional")
    differential = replace(demo.robot.drive, kind="differential")
    robots = [replace(demo.robot, drive=drive) for drive in (omnidirectional, differential)]
    assert len({kernel_list(replace(demo, robot=robot)) for robot in robots}) == 2


def test_what_lives_elsewhere_is_left_out_of_the_short_run(demo):
    outside = replace(demo, sut=SutReference("x", "ros2", {"launch": "nav2"}))
    assert short_run(outside).sut.kind == "idle"
    assert short_run(demo).sut == demo.sut
    assert short_run(demo).limit < demo.limit
