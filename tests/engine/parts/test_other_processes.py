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
import json, sys
from pathlib import Path
from daemon.model.spec import RunSpec
from daemon.run import execute, load_kernels, warm_up
from grammars.model.scene import Scene
from grammars.text import codec
from tests.engine.simulator.test_determinism import digest
from tests.engine.trace.recordings import record

folder = Path(sys.argv[1])
spec = codec.from_json(RunSpec, (folder / "spec.json").read_bytes())
scene = codec.from_json(Scene, (folder / "scene.json").read_bytes())
result = execute(spec, scene, trace_path=folder / "there.mcap")
record(folder / "recorded.mcap")
print(json.dumps([result.digest, digest(3)]))
"""

WARMED = """
import sys
from pathlib import Path
from daemon.run import execute, load_kernels, warm_up
from daemon.model.spec import RunSpec
from grammars.text import codec
from grammars.model.scene import Scene

folder = Path(sys.argv[1])
spec = codec.from_json(RunSpec, (folder / "spec.json").read_bytes())
scene = codec.from_json(Scene, (folder / "scene.json").read_bytes())
warm_up()
load_kernels(spec, scene)
before = set(sys.modules)
execute(spec, scene, trace_path=folder / "trace.mcap", leads=True)
print(*sorted(name for name in set(sys.modules) - before))
"""

KILLED = """
import os, signal, sys
from pathlib import Path
from daemon.trace import TraceWriter
from tests.engine.trace.recordings import record_until, scene, specification

world = scene()
trace = TraceWriter(Path(sys.argv[1]), specification(world), world)
record_until(trace, 25.0, 3)
os.kill(os.getpid(), signal.SIGKILL)
"""


def run(program, argument, **environment):
    command = [sys.executable, "-c", program, str(argument)]
    return subprocess.run(
        command, env=os.environ | environment, capture_output=True, text=True, check=True, cwd=ROOT
    ).stdout


@pytest.fixture
def folder(runs, tmp_path):
    """A folder with the scene of the demo, to which a specification is added."""
    (tmp_path / "scene.json").write_bytes(codec.to_json(runs.scene))
    return tmp_path


def test_another_process_computes_and_writes_the_same_bytes(runs, recorded, folder):
    """A run, a world full of doors and a recording, with other hashes in another time zone."""
    spec = replace(runs.submission.specs[5], limit=20.0)
    (folder / "spec.json").write_bytes(codec.to_json(spec))
    here = runs.execute(spec, folder / "here.mcap").digest
    seed = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    there = json.loads(run(ELSEWHERE, folder, PYTHONHASHSEED=seed, TZ="Asia/Tokyo"))
    assert there == [here, digest(3)]
    assert (folder / "there.mcap").read_bytes() == (folder / "here.mcap").read_bytes()
    assert (folder / "recorded.mcap").read_bytes() == recorded.read_bytes()


def test_a_warmed_process_loads_nothing_more_in_a_run(runs, folder):
    spec = replace(runs.submission.specs[0], limit=1.0)
    (folder / "spec.json").write_bytes(codec.to_json(spec))
    assert run(WARMED, folder).split() == []


def test_a_check_of_oracles_loads_nothing_that_judges():
    program = (
        "import sys; from daemon.judging.leading_kind import leading_kind, oracle_scale; "
        "print(*{'numba', 'shapely'} & sys.modules.keys())"
    )
    assert run(program, "").split() == []


def test_a_killed_writer_leaves_a_readable_partial_file(tmp_path):
    path = tmp_path / "run.mcap"
    with pytest.raises(subprocess.CalledProcessError) as ended:
        run(KILLED, path)
    assert ended.value.returncode == -signal.SIGKILL
    assert not path.exists()
    trace = read_trace(tmp_path / ("run.mcap" + PARTIAL), scans=True)
    assert not trace.complete
    assert trace.valid_until == pytest.approx(18.75)
    assert trace.scans[0].time[-1] == pytest.approx(18.7)
