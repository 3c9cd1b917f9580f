"""Dask clusters for tests, real ones: processes on loopback, to be watched and killed."""

import re
import subprocess
import sys
import time
from contextlib import contextmanager

import psutil

from grammars.text.files import matching_paths
from tests.parts import EXECUTOR, ROOT, Part, end, eventually, executions, family, free_endpoint

_SERVING = re.compile(r"^serving (\S+)$", re.MULTILINE)


class Dask:
    """A scheduler and its workers."""

    def __init__(self, folder, kind="same"):
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self._port = free_endpoint().rpartition(":")[2]
        self._started = []
        self.address = f"tcp://127.0.0.1:{self._port}"
        self.start_scheduler(kind)

    def start_scheduler(self, kind="same"):
        """Start it, again or for the first time, at the same address."""
        self.scheduler = self._start("scheduler", self._port, kind)

    def start_workers(self, *threads, kind="same"):
        """Start workers and return their processes as soon as they serve."""
        log = self.folder / f"worker-{time.monotonic_ns()}.log"
        first = self._start("worker", self.address, kind, *map(str, threads), log=log)
        eventually(lambda: len(_SERVING.findall(log.read_text())) == len(threads))
        return [first, *first.children()]

    def _start(self, *words, log=None):
        what, where, kind, *more = words
        command = [sys.executable, "-m", "tests.batch.dask_part", what, where, kind]
        with (log or self.folder / "scheduler.log").open("ab") as output:
            process = subprocess.Popen(
                [*command, str(self.folder / "scratch"), *more],
                cwd=ROOT,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        self._started.append(process)
        return psutil.Process(process.pid)

    def leftovers(self):
        """What runs have left behind."""
        return list(matching_paths(self.folder / "scratch", "**/scenario-*"))

    def close(self):
        for process in self._started:
            if process.poll() is None:
                end(family(process.pid))
                process.wait(60.0)


@contextmanager
def dask_in(folder, *threads, kind="same"):
    """A scheduler with workers for the block; nothing of them is left afterwards."""
    dask = Dask(folder, kind)
    try:
        if threads:
            dask.start_workers(*threads)
        yield dask
    finally:
        dask.close()


def gateway(dask, daemon, *options, executor=EXECUTOR):
    """A gateway between both; to be finished by the caller."""
    log = dask.folder / f"gateway-{time.monotonic_ns()}.log"
    base = ("--connect", daemon.endpoint, "--dask", dask.address, "--executor", executor)
    return Part("worker", log, *base, *options)


@contextmanager
def gateway_for(dask, daemon, *options, executor=EXECUTOR):
    """A gateway for the block; nothing of it is left afterwards."""
    part = gateway(dask, daemon, *options, executor=executor)
    try:
        yield part
    finally:
        part.kill()  # it has no children


def begun(log, count):
    """The processes of the runs that have begun and are not over, once there are as many."""
    going = [psutil.Process(pid) for pid in executions(log) if psutil.pid_exists(pid)]
    return going if len(going) >= count else []
