"""Empty runs through a local worker and through a gateway to a Dask cluster, side by side.

Both execute two at a time on this machine, each run in a process of its own, through daemon,
ledger and spool. What differs is the road: a pipe, or gateway, Dask scheduler and Dask worker.
"""

import tempfile
import time
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

import psutil

from tests.batch.dask_harness import dask_in, gateway_for
from tests.benchmarks.measurement import Measurement, Reference
from tests.make import make_submission
from tests.parts import daemon_at, eventually, family

LONG = "needs dask, starts a cluster"
_RUNS = 400
_SLOTS = 2
_ROUNDS = 2

Processes = Callable[[], list[psutil.Process]]


@contextmanager
def _local(folder):
    with daemon_at(folder / "state", _SLOTS) as daemon, daemon.client() as client:
        eventually(lambda: client.overview().workers, 60.0)
        yield client, lambda: family(daemon.pid)


@contextmanager
def _cluster(folder):
    with (
        daemon_at(folder / "state") as daemon,
        daemon.client() as client,
        dask_in(folder / "dask", _SLOTS) as dask,
        gateway_for(dask, daemon) as gateway,
    ):
        eventually(lambda: client.workers() and client.workers()[0].slots == _SLOTS, 60.0)
        pids = [daemon.pid, gateway.pid, *dask.pids]
        yield client, lambda: [process for pid in pids for process in family(pid)]


def _cpu(processes):
    """Seconds of processor time, of ended children too."""
    return sum(sum(process.cpu_times()[:4]) for process in processes)


def _measure(client, processes, name):
    before, start = _cpu(processes()), time.perf_counter()
    client.submit(make_submission(name, _RUNS))
    eventually(lambda: client.overview().queued + client.overview().running == 0, 600.0)
    return time.perf_counter() - start, _cpu(processes()) - before


def measure():
    """Yield time and processor time per run, round by round; the local worker is the reference."""
    with (
        tempfile.TemporaryDirectory() as name,
        _local(Path(name, "local")) as local,
        _cluster(Path(name, "cluster")) as cluster,
    ):
        for number in range(_ROUNDS):
            here = _measure(*local, f"round-{number}")
            there = _measure(*cluster, f"round-{number}")
            for what, unit, ours, theirs in zip(
                ("wall", "CPU"), ("ms", "CPU ms"), here, there, strict=True
            ):
                yield Measurement(
                    f"an empty run by Dask, {what}", 1e3 * theirs / _RUNS, unit,
                    Reference("a local worker", 1e3 * ours / _RUNS),
                )  # fmt: skip
