"""What a run began with is done in the fork server for those like it, and who is kept out."""

import os
import subprocess
import sys
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace

import pytest

from daemon.batch import kernel_compilation
from daemon.batch.run_process import RESULT
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._fork_server_preparation import ForkServerPreparation
from daemon.model.execution import DEFAULT_EXECUTOR, EXECUTOR_VARIABLE, PREPARATION_VARIABLE
from daemon.model.kernel_rooms import kernel_rooms
from daemon.model.messages import Lease
from daemon.model.spec import MapSettings, SutReference
from daemon.model.status import Preparation, PreparationPhase
from daemon.run import execute, warm_up
from grammars.text import codec
from tests.daemon.batch.samples import SCENE, make_result, make_spec

SERVER = """
import os, sys
from pathlib import Path
from daemon.batch import forkserver_preload
from daemon.model.spec import RunSpec
from grammars.model.scene import Scene
from grammars.text import codec

def child():
    import daemon.run_map
    daemon.run_map.building_grid = None
    scene, spec = Path(sys.argv[1]), Path(sys.argv[2])
    read = codec.from_json(RunSpec, spec.read_bytes())
    trace = Path(sys.argv[3])
    forkserver_preload.execute(read, codec.from_json(Scene, scene.read_bytes()), trace_path=trace)

process = os.fork()
if not process:
    child()
    os._exit(0)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]))
"""


@pytest.fixture
def preparation(monkeypatch):
    monkeypatch.setenv(EXECUTOR_VARIABLE, DEFAULT_EXECUTOR)
    monkeypatch.setenv(PREPARATION_VARIABLE, "")
    return ForkServerPreparation(lambda *_: pytest.fail("nothing is to be compiled"))


def example():
    """What the fork server is told to do: the file of a scene, the specification of a run."""
    return Path(os.environ[PREPARATION_VARIABLE]).read_text().split("\n")[1:]


def ended(folder, spec, **changes):
    attempt = Attempt.prepare(folder, Lease("c.0", "c", 1, 7, "c/0.mcap", spec))
    result = replace(make_result(spec), **changes)
    (folder / RESULT).write_bytes(codec.to_json(result))
    return attempt


def test_what_a_run_began_with_is_done_once_for_those_like_it(preparation, tmp_path):
    first, second = make_spec(0), make_spec(1)
    preparation.take_ended(ended(tmp_path / "a", first), tmp_path / "scene.json")
    preparation.take_ended(ended(tmp_path / "b", second), tmp_path / "scene.json")
    assert example() == [str(tmp_path / "scene.json"), codec.to_json(first).decode()]
    finer = replace(second, map=MapSettings(resolution=0.025))
    preparation.take_ended(ended(tmp_path / "c", finer), tmp_path / "scene.json")
    assert example()[1] == codec.to_json(finer).decode()


def test_what_might_keep_the_fork_server_is_left_to_the_runs(preparation, tmp_path):
    spec = make_spec()
    long = replace(make_result(spec).timing, cpu=1e3)
    plugin = replace(spec, sut=replace(spec.sut, kind="their-stack"))
    given = replace(spec, map=MapSettings(file="0" * 64))
    attempts = [
        ended(tmp_path / "crashed", spec, ended="crashed"),
        ended(tmp_path / "long", spec, timing=long),
        ended(tmp_path / "plugin", plugin),
        ended(tmp_path / "given", given),
        ended(tmp_path / "damaged", spec),
        Attempt.prepare(tmp_path / "lost", Lease("c.0", "c", 1, 7, "c/0.mcap", spec)),
    ]
    (tmp_path / "damaged" / RESULT).write_text("{")
    for attempt in attempts:
        preparation.take_ended(attempt, tmp_path / "scene.json")
    assert example() == []


def serve(folder, spec, scene, listed):
    """Execute a run in a child of a fork server that was told ``listed``: it cannot draw a map."""
    (folder / "scene.json").write_bytes(codec.to_json(scene))
    (folder / "spec.json").write_bytes(codec.to_json(spec))
    (folder / "list").write_text(listed)
    paths = [str(folder / name) for name in ("scene.json", "spec.json", "trace.mcap")]
    environment = {
        **os.environ,
        EXECUTOR_VARIABLE: DEFAULT_EXECUTOR,
        PREPARATION_VARIABLE: str(folder / "list"),
    }
    done = subprocess.run(
        [sys.executable, "-c", SERVER, *paths], env=environment, capture_output=True, text=True
    )
    return done.returncode, done.stderr


def test_a_run_that_finds_its_map_made_leaves_the_same_bytes(tmp_path):
    warm_up(kernel_rooms("pilot", {}))  # the server takes from the disk what is there
    spec = replace(make_spec(), limit=0.5, oracles=())
    example = f"{tmp_path / 'scene.json'}\n{codec.to_json(replace(spec, seed=9)).decode()}"
    assert serve(tmp_path, spec, SCENE, f"1 daemon.simulator\n{example}") == (0, "")
    execute(spec, SCENE, trace_path=tmp_path / "here.mcap")
    assert (tmp_path / "trace.mcap").read_bytes() == (tmp_path / "here.mcap").read_bytes()


def test_a_fork_server_outlives_a_scene_that_is_gone(tmp_path):
    spec = make_spec()
    listed = f"1 daemon.simulator\n{tmp_path / 'gone.json'}\n{codec.to_json(spec).decode()}"
    code, said = serve(tmp_path, spec, SCENE, listed)
    # The run begins with it itself, which in this test it cannot.
    assert code == 1
    assert "gone.json" in said
    assert "'NoneType' object is not callable" in said


def test_only_what_the_system_of_a_run_calls_is_compiled_and_how_far_that_is_is_said(monkeypatch):
    monkeypatch.setenv(EXECUTOR_VARIABLE, DEFAULT_EXECUTOR)
    monkeypatch.setenv(PREPARATION_VARIABLE, "")
    ours, theirs = Pipe(duplex=False)
    process = SimpleNamespace(join=lambda: None, close=lambda: None)
    preparation = ForkServerPreparation(lambda *_: (process, ours))
    pilot, ros = SutReference("p", "pilot", {}), SutReference("r", "ros", {})
    assert not preparation.prepare(pilot, 0)
    listed = Path(os.environ[PREPARATION_VARIABLE]).read_text().split()[1:]
    assert set(listed) == set(kernel_rooms("pilot", {}))
    theirs.send_bytes(kernel_compilation.WAITING)
    preparation.listen()
    assert preparation.standing == Preparation(PreparationPhase.WAITING)
    theirs.send_bytes(kernel_compilation.COUNT + b"63 164")
    preparation.listen()
    assert preparation.standing == Preparation(PreparationPhase.COMPILING, 63, 164)
    assert not preparation.prepare(ros, 0), "one compiles at a time"
    theirs.send_bytes(kernel_compilation.READY)
    theirs.close()
    preparation.listen()
    assert preparation.standing is None
    assert preparation.prepare(pilot, 0)
