"""A stand-in for ``daemon.run`` that leaves a real, small MCAP trace.

The parameters of the system under test say how long it takes (``sleep`` [s]), how much of what
does not compress the trace holds (``ballast`` [bytes]), how much it prints (``chatter`` [bytes]) and
where it notes that it begins and ends (``log``, a file read by :mod:`tests.chaos.executions`). Same
specification, same bytes.
"""

from __future__ import annotations

import hashlib
import json
import random
import time
from collections.abc import Callable
from pathlib import Path

from mcap.writer import CompressionType, Writer

from daemon.model.spec import RunResult, RunSpec, Snapshot, TraceInfo
from grammars.model.scene import Scene
from tests.chaos.executions import note
from tests.daemon.batch.samples import make_result

MESSAGES = 20


def execute(
    spec: RunSpec,
    scene: Scene,
    *,
    trace_path: Path,
    on_progress: Callable[[Snapshot], None] | None = None,
    interest: Callable[[], str] | None = None,
) -> RunResult:
    asked = spec.sut.parameters
    log = asked.get("log", "")
    note(log, "begin", spec)
    _chatter(asked.get("chatter", 0))
    time.sleep(asked.get("sleep", 0.0))
    _record(trace_path, spec.digest, asked.get("ballast", 0))
    data = trace_path.read_bytes()
    trace = TraceInfo(hashlib.sha256(data).hexdigest(), len(data), MESSAGES)
    note(log, "end", spec)
    return make_result(spec, trace=trace)


def _chatter(size: int) -> None:
    """Print that many bytes, as a program under test does that reports every step."""
    line = "step after step, and a word about each of them\n"
    for _ in range(size // len(line)):
        print(line, end="")


def _record(path: Path, digest: str, ballast: int) -> None:
    noise = random.Random(digest)
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="", library="chaos")
        schema = writer.register_schema("Step", "jsonschema", b"{}")
        channel = writer.register_channel("/step", "json", schema)
        for step in range(MESSAGES):
            text = {"run": digest, "step": step, "noise": noise.randbytes(ballast // 40).hex()}
            at = step * 50_000_000
            writer.add_message(channel, at, json.dumps(text).encode(), at)
        writer.finish()  # type: ignore[no-untyped-call]
