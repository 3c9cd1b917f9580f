"""What a run began with is done in the zygote for those like it, and who is kept out."""

import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from multiprocessing.connection import wait

import psutil

from daemon.batch.run_process import RESULT, TRACE, RunTask
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._zygotes import ZygotePool
from daemon.batch.zygote import read_example
from daemon.model.execution import RunLimits
from daemon.model.messages import Lease
from daemon.model.spec import SutReference
from daemon.run import execute
from grammars.text import codec
from tests.make import SCENE, make_result, make_spec

FORKING = """
import os, sys
from pathlib import Path
from daemon import run_map
from daemon.run import execute, prepare
from daemon.model.spec import RunSpec
from grammars.model.scene import Scene
from grammars.text import codec

spec = codec.from_json(RunSpec, Path(sys.argv[1]).read_bytes())
scene = codec.from_json(Scene, Path(sys.argv[2]).read_bytes())
prepare(spec, scene)
run_map.building_grid = None
execute(spec, scene, trace_path=Path(sys.argv[3]))
"""


def ended(folder, spec, **changes):
    """The task of a run that has ended."""
    lease = Lease("c.0", "c", 1, 7, "c/0.mcap", spec)
    Attempt.prepare(folder, lease)
    (folder / RESULT).write_bytes(codec.to_json(replace(make_result(spec), **changes)))
    (folder / "scene.json").write_bytes(codec.to_json(SCENE))
    return RunTask(folder, folder / "scene.json", 0, 0, 10.0)


def test_what_might_keep_the_zygote_is_left_to_the_runs(tmp_path):
    spec = make_spec()
    long = replace(make_result(spec).timing, cpu=1e3)
    assert read_example(ended(tmp_path / "good", spec)) == (spec, SCENE)
    assert read_example(ended(tmp_path / "crashed", spec, ended="crashed")) is None
    assert read_example(ended(tmp_path / "long", spec, timing=long)) is None
    damaged, gone = ended(tmp_path / "damaged", spec), ended(tmp_path / "gone", spec)
    (tmp_path / "damaged" / RESULT).write_text("{")
    gone.scene.unlink()
    assert read_example(damaged) is None
    assert read_example(gone) is None


def test_a_run_finds_the_map_of_the_one_before(tmp_path):
    spec = replace(make_spec(), limit=0.5, oracles=())
    for name, value in (("spec", spec), ("scene", SCENE)):
        (tmp_path / name).write_bytes(codec.to_json(value))
    paths = [str(tmp_path / name) for name in ("spec", "scene", "trace.mcap")]
    done = subprocess.run([sys.executable, "-c", FORKING, *paths], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    execute(spec, SCENE, trace_path=tmp_path / "here.mcap")
    assert (tmp_path / "trace.mcap").read_bytes() == (tmp_path / "here.mcap").read_bytes()


def test_a_worker_compiles_once_and_says_how_far_it_is(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    spec = replace(make_spec(), sut=SutReference("idle", "idle", {}), limit=0.5)
    scene = tmp_path / "scene.json"
    scene.write_bytes(codec.to_json(SCENE))
    counts = []
    for number in range(2):
        with closing(ZygotePool(1)) as pool:
            seen = []
            while not pool.prepare(spec, scene, RunLimits()):
                wait(pool.waitables)
                pool.listen()
                seen.append(pool.preparation.done if pool.preparation else 0)
            counts.append(max(seen))
            attempt = Attempt.prepare(tmp_path / f"{number}", Lease("c.0", "c", 1, 7, "c/0", spec))
            execution = pool.start(attempt, scene, RunLimits())
            while execution.end is None:
                wait(execution.waitables)
                execution.listen()
            execution.close()
            assert attempt.finished, execution.end.why
    compiled = len(list((tmp_path / "kernels").rglob("*.nbi")))
    assert counts[0] > 1
    assert counts[1] == 0
    assert len(list((tmp_path / "kernels").rglob("*.nbc"))) == compiled


def test_a_short_run_that_is_killed_leaves_compiling_to_the_run(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    spec = replace(make_spec(), limit=0.5, oracles=())
    scene = tmp_path / "scene.json"
    scene.write_bytes(codec.to_json(SCENE))
    with closing(ZygotePool(1)) as pool:
        killed = False
        while not pool.prepare(spec, scene, RunLimits()):
            wait(pool.waitables)
            pool.listen()
            if pool.preparation and not killed:
                (zygote,) = (
                    one for one in psutil.Process().children()
                    if "daemon.batch.zygote" in one.cmdline()
                )  # fmt: skip
                for child in zygote.children():
                    child.kill()
                killed = True
        assert killed
        attempt = Attempt.prepare(tmp_path / "run", Lease("c.0", "c", 1, 7, "c/0", spec))
        execution = pool.start(attempt, scene, RunLimits())
        while execution.end is None:
            wait(execution.waitables)
            execution.listen()
        execution.close()
        assert attempt.finished, execution.end.why


def test_runs_of_one_zygote_leave_the_same_bytes_whoever_is_first(tmp_path):
    spec = replace(make_spec(), limit=0.5, oracles=())
    (tmp_path / "scene.json").write_bytes(codec.to_json(SCENE))
    with closing(ZygotePool(1)) as pool:
        seen = []
        while not pool.prepare(spec, tmp_path / "scene.json", RunLimits()):
            wait(pool.waitables)
            pool.listen()
            seen.append(pool.preparation)
        assert pool.preparation is None
        for number in range(2):
            attempt = Attempt.prepare(tmp_path / f"{number}", Lease("c.0", "c", 1, 7, "c/0", spec))
            execution = pool.start(attempt, tmp_path / "scene.json", RunLimits())
            while execution.end is None:
                wait(execution.waitables)
                execution.listen()
            execution.close()
            assert attempt.finished, execution.end.why
    execute(spec, SCENE, trace_path=tmp_path / "here.mcap")
    expected = (tmp_path / "here.mcap").read_bytes()
    assert [(tmp_path / f"{n}" / TRACE).read_bytes() for n in range(2)] == 2 * [expected]
