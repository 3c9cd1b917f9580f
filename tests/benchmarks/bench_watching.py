"""What it costs a run that somebody watches it: CPU with everything told, a little, nothing."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Iterator
from multiprocessing import Pipe
from pathlib import Path

from daemon.batch.run_process import WATCHED, SnapshotSender
from daemon.campaign import expand, load_campaign
from daemon.run import execute, warm_up
from tests.benchmarks.measurement import Measurement, Reference

CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "demo" / "campaign.yaml"
TIMES = 5


def measure() -> Iterator[Measurement]:
    """Execute the same run several ways in turn; the least of each."""
    warm_up()
    campaign = expand(load_campaign(CAMPAIGN))
    spec = campaign.runs[0]
    scene = next(s for s in campaign.scenes if s.digest == spec.scene)
    ways = ("nobody asks", "progress", "watched")
    found: dict[str, list[float]] = {way: [] for way in ways}
    told = dict.fromkeys(ways, 0)
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(TIMES):
            for way in ways:
                cpu, messages = _once(spec, scene, Path(folder), way)
                found[way].append(cpu)
                told[way] = messages
    least = {way: min(values) for way, values in found.items()}
    for way in ways:
        beside = None if way == ways[0] else Reference(ways[0], least[ways[0]])
        yield Measurement(way, least[way], "CPU s", beside, (), f"{told[way]} snapshots")


def _once(spec, scene, folder: Path, way: str) -> tuple[float, int]:  # type: ignore[no-untyped-def]
    """Return the CPU time of one execution [s] and how many snapshots it told."""
    ours, theirs = Pipe(duplex=False)
    mark = folder / WATCHED
    mark.touch() if way == "watched" else mark.unlink(missing_ok=True)
    reporter = SnapshotSender("run", theirs, mark)
    asked = {} if way == "nobody asks" else {"on_progress": reporter, "interest": reporter.interest}
    messages: list[int] = []
    drain = threading.Thread(target=_drain, args=(ours, messages))
    drain.start()
    before = time.thread_time()
    execute(spec, scene, trace_path=folder / "run.mcap", **asked)
    cpu = time.thread_time() - before
    theirs.close()
    drain.join()
    return cpu, len(messages)


def _drain(wire, messages: list[int]) -> None:  # type: ignore[no-untyped-def]
    while True:
        try:
            messages.append(len(wire.recv_bytes()))
        except EOFError:
            return
