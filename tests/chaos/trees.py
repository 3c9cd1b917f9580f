"""A system under test that leaves a tree of processes: nothing of it outlives its run."""

import signal
import time
from contextlib import suppress

import psutil

from daemon.model.run_state import RunState
from tests.chaos.executor import EXECUTOR, TREE
from tests.chaos.report import Report
from tests.make import make_submission
from tests.parts import alive, daemon_at, eventually

PATIENCE = 40.0
"""Seconds that a tree may take to end: a daemon told to stop lets its runs finish for 20 s."""
ENDINGS = (
    "done",
    "raise",
    "crash",
    "cancel",
    "wall limit",
    "process of the run killed",
    "worker killed",
    "worker stopped",
    "daemon killed",
    "daemon stopped",
)


def trees(folder, *, endings=ENDINGS):
    """End a run in every way there is; the processes it started end with it."""
    report = Report("trees: processes that a system under test leaves")
    for number, ending in enumerate(endings):
        part = Report(f"trees, {ending}")
        try:
            _end(part, folder / str(number), ending)
        except AssertionError as error:
            part.violations.append(str(error))
        part.end()
        report.include(part)
    return report


def _end(part, folder, ending):
    folder.mkdir()
    pids, gate = folder / "pids", folder / "gate"
    wall = 3.0 if ending == "wall limit" else 300.0
    quick = ending in ("done", "raise", "crash")
    asked = {"tree": str(pids), "ending": ending}
    asked |= {"sleep": 0.1} if quick else {"until": str(gate)}
    with (
        daemon_at(folder / "state", 1, executor=EXECUTOR, wall=wall, attempts=1) as daemon,
        daemon.client() as client,
    ):
        client.submit(make_submission("tree", 1, **asked))
        processes = eventually(lambda: _tree(pids))
        local = psutil.Process(daemon.pid).children()
        _acts(daemon, processes).get(ending, lambda: None)()
        if ending == "daemon killed":
            gate.touch()  # its worker finishes what runs, and leaves
            eventually(lambda: not alive(local))
        if ending == "cancel":
            client.cancel("tree")
            eventually(lambda: client.runs("tree").rows[0].state is RunState.CANCELLED)
        deadline = time.monotonic() + PATIENCE
        while alive(processes) and time.monotonic() < deadline:
            time.sleep(0.1)
        left = alive(processes)
        part.runs, part.executions = 1, 1
        part.expect(not left, f"{len(left)} of {TREE} processes were left")
        for process in left:
            with suppress(psutil.NoSuchProcess):
                process.kill()


def _acts(daemon, processes):
    """What is done to end the run, by the name of the ending."""
    children = psutil.Process(daemon.pid).children()
    local = [child for child in children if "worker" in child.cmdline()]

    def kill_run():
        """The process that started the first of the tree."""
        ours = {process.pid for process in processes}
        parents = [process.parent() for process in processes]
        (first,) = {parent for parent in parents if parent is not None and parent.pid in ours}
        first.parent().kill()

    return {
        "worker killed": lambda: local[0].kill(),
        "worker stopped": lambda: local[0].send_signal(signal.SIGQUIT),
        "daemon killed": daemon.kill,
        "daemon stopped": lambda: daemon.signal(signal.SIGTERM),
        "process of the run killed": kill_run,
    }


def _tree(pids):
    numbers = pids.read_text().split() if pids.exists() else []
    if len(numbers) < TREE:
        return []
    found = []
    for number in numbers:
        with suppress(psutil.NoSuchProcess):
            found.append(psutil.Process(int(number)))
    return found
