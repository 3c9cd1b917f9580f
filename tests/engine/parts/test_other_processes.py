"""What other processes compute, load and leave."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace

import pytest

from daemon.trace import PARTIAL, read_trace
from grammars.text import codec
from tests.engine.simulator.test_determinism import digest
from tests.parts import ROOT

ELSEWHERE = """
import json, os, signal, sys
from pathlib import Path
from daemon.model.spec import RunSpec
from daemon.run import execute, load_kernels, warm_up
from grammars.model.scene import Scene
from grammars.text import codec

folder = Path(sys.argv[1])
spec = codec.from_json(RunSpec, (folder / "spec.json").read_bytes())
scene = codec.from_json(Scene, (folder / "scene.json").read_bytes())
warm_up()
load_kernels(spec, scene)
before = set(sys.modules)
result = execute(spec, scene, trace_path=folder / "there.mcap", leads=True)
loaded = sorted(set(sys.modules) - before)

from daemon.trace import TraceWriter
from tests.engine.simulator.test_determinism import digest
from tests.engine.trace import recordings

recordings.record(folder / "recorded.mcap")
print(json.dumps([loaded, result.digest, digest(3)]), flush=True)
world = recordings.scene()
trace = TraceWriter(folder / "killed.mcap", recordings.specification(world), world)
recordings.record_until(trace, 25.0, 3)
os.kill(os.getpid(), signal.SIGKILL)
"""


def run(program, argument, **environment):
    command = [sys.executable, "-c", program, str(argument)]
    return subprocess.run(
        command, env=os.environ | environment, capture_output=True, text=True, cwd=ROOT
    )


@pytest.fixture(scope="module")
def elsewhere(runs, tmp_path_factory):
    """A run by a warmed process with other hashes in another time zone, and what that told."""
    folder = tmp_path_factory.mktemp("elsewhere")
    spec = replace(runs.submission.specs[5], limit=5.0)
    (folder / "spec.json").write_bytes(codec.to_json(spec))
    (folder / "scene.json").write_bytes(codec.to_json(runs.scene))
    seed = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    ended = run(ELSEWHERE, folder, PYTHONHASHSEED=seed, TZ="Asia/Tokyo")
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    return spec, folder, json.loads(ended.stdout)


def test_another_process_computes_and_writes_the_same_bytes(runs, recorded, elsewhere, tmp_path):
    """A run, a world full of doors and a recording."""
    spec, folder, (_, *there) = elsewhere
    here = runs.execute(spec, tmp_path / "here.mcap").digest
    assert there == [here, digest(3)]
    assert (folder / "there.mcap").read_bytes() == (tmp_path / "here.mcap").read_bytes()
    assert (folder / "recorded.mcap").read_bytes() == recorded.read_bytes()


def test_a_warmed_process_loads_nothing_more_in_a_run(elsewhere):
    assert elsewhere[2][0] == []


def test_a_killed_writer_leaves_a_readable_partial_file(elsewhere):
    path = elsewhere[1] / "killed.mcap"
    assert not path.exists()
    trace = read_trace(path.with_name(path.name + PARTIAL), scans=True)
    assert not trace.complete
    assert trace.valid_until == pytest.approx(18.75)
    assert trace.scans[0].time[-1] == pytest.approx(18.7)


def test_a_check_of_oracles_loads_nothing_that_judges():
    program = (
        "import sys; from daemon.judging.leading_kind import oracle_scale, why_flat; "
        "print(*{'numba', 'shapely'} & sys.modules.keys())"
    )
    ended = run(program, "")
    assert (ended.returncode, ended.stdout.split()) == (0, [])
