"""What it costs a run that somebody watches it: CPU, and bytes a second on the line."""

import socket
import tempfile
import threading
import time
from pathlib import Path

from daemon.batch.run_process import (
    JUDGEMENT,
    LARGEST_MESSAGE,
    LIVE,
    WATCH,
    SnapshotSender,
    WatchDetail,
)
from daemon.run import execute
from tests.benchmarks.bench_run import PAPER
from tests.benchmarks.case_process import run_of
from tests.benchmarks.measurement import Measurement, Reference, at_most
from tests.kernels import load_all

TIMES = 5
NOBODY = "nobody asks"
WAYS = {
    NOBODY: (),
    "progress": (),
    "margins": (WatchDetail.MARGIN,),
    "watched": (WatchDetail.DETAILS,),
    "judged": (WatchDetail.DETAILS, WatchDetail.JUDGEMENT, WatchDetail.MARGIN),
}
"""What is wanted of a run."""


def measure():
    """Execute the same run several ways in turns; the least of each, nobody being the reference."""
    load_all()
    run = run_of(PAPER / "campaign.yaml", "S3.2", "a2s")
    found = {way: [] for way in WAYS}
    for _ in range(TIMES):
        for way in WAYS:
            found[way].append(executed(*run, way))
    nobody = None
    for way, several in found.items():
        cpu, snapshots, judgements, _ = min(several)
        told = f"{snapshots} snapshots, {judgements} judgements"
        yield Measurement(way, cpu, "CPU s", nobody, (), told)
        nobody = nobody or Reference(way, cpu)
    rate = max(one[-1] for one in found["judged"]) / 1e3
    yield Measurement("bytes of a run that is judged", rate, "kB/s", None, (at_most(40.0),))


def executed(spec, scene, way):
    """Return CPU seconds, numbers of snapshots and judgements told, and bytes a second."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    sender, asked = SnapshotSender("run", theirs), {}
    if way != NOBODY:
        ours.send(WATCH + " ".join(WAYS[way]).encode())
        asked = {"on_progress": sender, "interest": sender.interest, "judgements": sender}
    sizes = {LIVE: [], JUDGEMENT: []}
    drain = threading.Thread(target=_drain, args=(ours, sizes))
    drain.start()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        before, began = time.thread_time(), time.monotonic()
        execute(spec, scene, trace_path=path, **asked)
        cpu, wall = time.thread_time() - before, time.monotonic() - began
    theirs.close()
    drain.join()
    told = sum(map(sum, sizes.values()))
    return cpu, len(sizes[LIVE]), len(sizes[JUDGEMENT]), told / wall


def _drain(wire, sizes):
    with wire:
        while message := wire.recv(LARGEST_MESSAGE):
            sizes[message[:1]].append(len(message) - 1)
