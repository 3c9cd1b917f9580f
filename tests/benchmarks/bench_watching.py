"""What it costs a run that somebody watches it: CPU, and bytes a second on the line."""

import socket
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from daemon.batch.run_process import (
    JUDGEMENT,
    LARGEST_MESSAGE,
    LIVE,
    WATCH,
    SnapshotSender,
    Wanted,
)
from daemon.campaign import expand, load_campaign
from daemon.run import execute
from tests.benchmarks.measurement import Measurement, Reference, at_most
from tests.kernels import load_all

CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "ortega2024" / "campaign.yaml"
LABEL = "S3.2/a2s/0"
TIMES = 5
NOBODY = "nobody asks"
WAYS = {
    NOBODY: (),
    "progress": (),
    "margins": (Wanted.MARGIN,),
    "watched": (Wanted.DETAILS,),
    "judged": (Wanted.DETAILS, Wanted.JUDGEMENT, Wanted.MARGIN),
}
"""What is wanted of a run."""


def measure():
    """Execute the same run several ways in turn; the least of each."""
    load_all()
    campaign = expand(load_campaign(CAMPAIGN))
    spec = next(run for run in campaign.specs if run.label == LABEL)
    scene = next(s for s in campaign.scenes if s.digest == spec.scene)
    found = {way: [] for way in WAYS}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(TIMES):
            for way in WAYS:
                found[way].append(_once(spec, scene, Path(folder), way))
    least = {way: min(several, key=lambda one: one.cpu) for way, several in found.items()}
    for way, one in least.items():
        beside = None if way == NOBODY else Reference(NOBODY, least[NOBODY].cpu)
        told = f"{one.snapshots} snapshots, {one.judgements} judgements"
        yield Measurement(way, one.cpu, "CPU s", beside, (), told)
    rate = max(one.rate for one in found["judged"]) / 1e3
    yield Measurement("bytes of a run that is judged", rate, "kB/s", None, (at_most(40.0),))


@dataclass(frozen=True, slots=True)
class _Watching:
    """CPU time of one execution [s], how much it told, and how many bytes a second that was."""

    cpu: float
    snapshots: int
    judgements: int
    rate: float


def _once(spec, scene, folder, way):
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.send(WATCH + " ".join(WAYS[way]).encode())
    reporter = SnapshotSender("run", theirs)
    asked = (
        {}
        if way == NOBODY
        else {"on_progress": reporter, "interest": reporter.interest, "judgements": reporter}
    )
    sizes = {LIVE: [], JUDGEMENT: []}
    drain = threading.Thread(target=_drain, args=(ours, sizes))
    drain.start()
    before, began = time.thread_time(), time.monotonic()
    execute(spec, scene, trace_path=folder / "run.mcap", **asked)
    cpu, wall = time.thread_time() - before, time.monotonic() - began
    theirs.close()
    drain.join()
    told = sum(map(sum, sizes.values()))
    return _Watching(cpu, len(sizes[LIVE]), len(sizes[JUDGEMENT]), told / wall)


def _drain(wire, sizes):
    with wire:
        while message := wire.recv(LARGEST_MESSAGE):
            sizes[message[:1]].append(len(message) - 1)
