"""Zygotes: processes that load and compile what runs need, and from which each run is forked."""

import itertools
import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from multiprocessing.connection import wait
from types import SimpleNamespace

import psutil
import pytest

from daemon.batch.run_process import RESULT, TRACE, RunTask
from daemon.batch.worker import _work, _zygotes, work
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._zygotes import ZygotePool
from daemon.batch.zygote import read_example
from daemon.model.execution import RunLimits, python_command
from daemon.model.messages import Lease
from daemon.model.spec import SutReference
from daemon.model.status import Preparation, PreparationPhase
from daemon.run import execute
from grammars.text import codec
from tests.make import SCENE, make_result, make_spec, submission_of
from tests.parts import EXECUTOR, ROOT, alive, eventually

SHORT = replace(make_spec(), limit=0.5, oracles=())
LIMITS = RunLimits(nice=0)


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.json"
    path.write_bytes(codec.to_json(SCENE))
    return path


def attempt_in(folder, spec, **more):
    return Attempt.prepare(folder, Lease("c.0", "c", 1, 7, "c/0.mcap", spec, **more))


def prepare(pool, spec, scene, look=lambda: None):
    """Wait until a run can be started."""
    while not pool.prepare(spec, scene, LIMITS):
        wait(pool.waitables)
        pool.listen()
        look()


def run(pool, folder, spec, scene, limits=LIMITS, **more):
    """Have a run executed; returns its attempt and why it ended badly."""
    attempt = attempt_in(folder / "attempt-1", spec, **more)
    execution = pool.start(attempt, scene, limits)
    while execution.end is None:
        wait(execution.waitables)
        execution.listen()
    execution.close()
    return attempt, execution.end.why


def zygote_of_mine():
    mine = psutil.Process().children()
    (zygote,) = [one for one in alive(mine) if "daemon.batch.zygote" in one.cmdline()]
    return zygote


# --- what is done once for all runs


@pytest.fixture
def ended(tmp_path, scene):
    """The task of a run that has ended."""

    def ended(name, **changes):
        attempt_in(tmp_path / name, SHORT)
        result = replace(make_result(SHORT), **changes)
        (tmp_path / name / RESULT).write_bytes(codec.to_json(result))
        return RunTask(tmp_path / name, scene, 0, 0, 10.0)

    return ended


def test_what_might_keep_the_zygote_is_left_to_the_runs(ended, tmp_path):
    long = replace(make_result(SHORT).timing, cpu=1e3)
    assert read_example(ended("good")) == (SHORT, SCENE)
    assert read_example(ended("crashed", ended="crashed")) is None
    assert read_example(ended("long", timing=long)) is None
    damaged = ended("damaged")
    (tmp_path / "damaged" / RESULT).write_text("{")
    assert read_example(damaged) is None
    gone = ended("gone")
    gone.scene.unlink()
    assert read_example(gone) is None


def test_runs_of_one_zygote_leave_the_same_bytes_whoever_is_first(tmp_path, scene):
    here = tmp_path / "here.mcap"
    execute(SHORT, SCENE, trace_path=here)
    with closing(ZygotePool(1)) as pool:
        prepare(pool, SHORT, scene)
        assert pool.preparation is None
        for name in ("first", "second"):
            assert run(pool, tmp_path / name, SHORT, scene)[1] == ""
            assert (tmp_path / name / "attempt-1" / TRACE).read_bytes() == here.read_bytes()


# --- runs


def test_a_run_is_nice_and_leaves_leading_margins_where_its_lease_asks_for_them(
    pool, tmp_path, scene
):
    spec, log = make_spec(log=str(tmp_path / "log")), tmp_path / "log"
    prepare(pool, spec, scene)
    for leads, margins in ((False, []), (True, [0.5])):
        attempt, why = run(pool, tmp_path / f"{leads}", spec, scene, RunLimits(), leads=leads)
        assert [lead.margin for lead in attempt.result().leads] == margins, why
    nice = str(max(10, os.getpriority(os.PRIO_PROCESS, 0)))  # tests may be nice themselves
    assert [line.split()[2] for line in log.read_text().splitlines()] == [nice, nice]


DRAWING = """
import os
from numpy import random
from tests.fake_run import execute as execute_fake

def execute(spec, scene, **rest):
    with open(os.environ["DRAWN"], "a") as file:
        file.write(f"{random.random()}\\n")
    return execute_fake(spec, scene, **rest)
"""


def test_chance_that_nobody_has_seeded_differs_between_runs_of_a_worker(
    tmp_path, scene, monkeypatch
):
    (tmp_path / "drawing.py").write_text(DRAWING)
    monkeypatch.setenv("DRAWN", str(tmp_path / "drawn.txt"))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{ROOT}")
    with closing(ZygotePool(1, "drawing:execute")) as pool:
        pool.warm_up()
        for name in ("first", "second"):
            assert run(pool, tmp_path / name, make_spec(), scene)[1] == ""
    assert len(set((tmp_path / "drawn.txt").read_text().splitlines())) == 2


@pytest.fixture(scope="module")
def pool():
    with closing(ZygotePool(1, EXECUTOR)) as pool:
        pool.warm_up()
        yield pool


def begin(pool, folder, scene):
    """Have a run begin that lasts, and leaves processes behind."""
    folder.mkdir()
    spec, file = make_spec(leaves=str(folder / "left"), sleep=600.0), folder / "left"
    eventually(lambda: pool.listen() or pool.prepare(spec, scene, LIMITS))
    execution = pool.start(attempt_in(folder / "attempt-1", spec), scene, LIMITS)
    numbers = eventually(lambda: file.exists() and len(n := file.read_text().split()) == 2 and n)
    return execution, [psutil.Process(int(number)) for number in numbers]


def is_over(execution):
    execution.listen()
    if execution.end is not None:
        execution.close()
    return execution.end is not None


def test_a_guardian_that_is_stopped_keeps_no_run(pool, tmp_path, scene, monkeypatch):
    execution, left = begin(pool, tmp_path / "run", scene)
    minutes = itertools.count(time.monotonic(), 60.0)
    monkeypatch.setattr(_zygotes, "time", SimpleNamespace(monotonic=lambda: next(minutes)))
    zygote = zygote_of_mine()
    (guardian,) = zygote.children()
    guardian.send_signal(signal.SIGSTOP)
    zygote.send_signal(signal.SIGSTOP)
    execution.kill("not wanted")
    eventually(lambda: is_over(execution))
    assert not alive([zygote])
    guardian.send_signal(signal.SIGCONT)
    eventually(lambda: not alive([guardian, *left]))


def test_a_zygote_that_died_is_replaced(pool, tmp_path, scene):
    execution, left = begin(pool, tmp_path / "first", scene)
    zygote = zygote_of_mine()
    assert "-P" in zygote.cmdline()  # modules in the current folder are not taken for ours
    zygote.kill()
    eventually(lambda: is_over(execution))
    eventually(lambda: not alive(left))
    execution, left = begin(pool, tmp_path / "again", scene)
    execution.kill("not wanted")
    eventually(lambda: is_over(execution))
    assert not alive(left)


# --- whose modules they load


@pytest.fixture
def foreign(tmp_path):
    """A folder in which somebody keeps modules that have our names."""
    for name in ("daemon", "templates", "scenario_tui"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('somebody else')")
    return tmp_path


def test_a_module_in_the_current_folder_is_never_taken_for_ours(foreign):
    words = ("-m", "daemon", "serve", "{}")
    theirs = subprocess.run([sys.executable, *words], cwd=foreign, capture_output=True, text=True)
    assert "somebody else" in theirs.stderr
    ours = subprocess.run(python_command(*words), cwd=foreign, capture_output=True, text=True)
    assert "Missing required argument" in ours.stderr


# --- kernels that are still compiled


class Compiling:
    """A backend with the kernels of ``pilot`` alone; ends the worker when it has seen enough.

    That is a start, or with ``alone`` that the daemon calls all of its slots busy.
    """

    slots = 2
    waitables = ()
    trouble = ""

    def __init__(self, client, alone):
        self.client, self.alone = client, alone
        self.started, self.busy, self.looks = [], 0, 0

    @property
    def preparation(self):
        """Goes on and on, so that a renewal is always due."""
        self.looks += 1
        return Preparation(PreparationPhase.COMPILING, self.looks)

    def listen(self): ...

    def prepare(self, spec, *_):
        if spec.sut.kind == "pilot":
            return True
        self.busy = sum(row.busy for row in self.client.workers())
        if self.alone and self.busy == self.slots:
            os.kill(os.getpid(), signal.SIGQUIT)
        return False

    def start(self, attempt, *_):
        self.started.append(attempt.lease.run)
        os.kill(os.getpid(), signal.SIGQUIT)
        raise OSError("it has been seen")


@pytest.mark.parametrize(("kinds", "started"), [("ros pilot", ["c.1"]), ("ros ros ros", [])])
def test_runs_that_wait_for_kernels_have_their_slots_and_keep_no_other_waiting(
    shared, client, monkeypatch, kinds, started
):
    specs = [
        replace(make_spec(n), sut=SutReference(kind, kind, {}))
        for n, kind in enumerate(kinds.split())
    ]
    backend = Compiling(client, alone=not started)
    monkeypatch.setattr(_work, "_open_backend", lambda *_: backend)
    client.submit(submission_of("c", *specs))
    work(shared.endpoint, slots=2, executor=EXECUTOR)
    client.cancel("c")
    client.delete(("c",))
    assert backend.started == started
    assert started or backend.busy == 2
