"""Traces on their way: what parts, base64 and digests cost, and what others notice of it.

A real daemon over loopback; the sender is this process. CPU times are of the daemon process. At the
end short runs over a link of 200 ms: a worker elsewhere, behind a line that delays every byte.
"""

from __future__ import annotations

import hashlib
import random
import shutil
import statistics
import tempfile
import threading
import time
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path

from daemon.batch.client import Client
from daemon.batch.stores import TraceReference, copy_trace, encode_chunk
from daemon.model import verbs
from daemon.model.messages import (
    LARGEST_CHUNK,
    Completion,
    Lease,
    LeaseRequest,
    TraceUploadChunk,
    WorkerInfo,
)
from daemon.model.spec import TraceInfo
from tests.benchmarks.bench_daemon import cpu, fresh, row
from tests.chaos.lines import slow_line
from tests.daemon.batch.harness import DaemonPart, eventually, finished, worker_for
from tests.daemon.batch.samples import make_result, make_submission

SIZE = 64 * 2**20
SMALL = 64 * 2**10
DISTANT = 100
DISTANT_TRACE = 2**20
ME = WorkerInfo("bench-1", "bench", 1, version("scenario-tui"), 1, 0)


def upload(client: Client, grant: Lease, data: bytes, size: int) -> None:
    sha256 = hashlib.sha256(data).hexdigest()
    for offset in range(0, len(data), size):
        text, digest = encode_chunk(data[offset : offset + size])
        chunk = TraceUploadChunk(
            ME.id, grant.run, grant.token, sha256, len(data), offset, text, digest
        )
        received = client.ask(verbs.UPLOAD, chunk)
        assert not received.problem, received.problem
    result = make_result(grant.spec, trace=TraceInfo(sha256, len(data), 1))
    done = Completion(ME.id, grant.run, 1, grant.token, result, uploaded=True)
    client.ask(verbs.COMPLETE, done)


def rates(daemon: DaemonPart, client: Client, folder: Path) -> None:
    client.submit(make_submission("c", 3))
    reply = client.ask(verbs.LEASE, LeaseRequest(ME, 3))
    data = random.Random(1).randbytes(SIZE)
    plain = folder / "plain"
    begun = time.perf_counter()
    plain.write_bytes(data)
    shutil.copyfile(plain, folder / "copy")
    copied = time.perf_counter() - begun
    for grant, size in zip(reply.grants, (LARGEST_CHUNK, SMALL), strict=False):
        spent, begun = cpu(daemon.pid), time.perf_counter()
        upload(client, grant, data, size)
        took, spent = time.perf_counter() - begun, cpu(daemon.pid) - spent
        mega = SIZE / 1e6
        row(
            f"upload {mega:.0f} MB in parts of {size // 1024} KiB",
            f"{mega / took:.0f} MB/s",
            f"daemon {1000 * spent / mega:.1f} ms CPU per MB, {took / copied:.1f} x write and copy",
        )
    spent, begun = cpu(daemon.pid), time.perf_counter()
    trace = TraceReference("c.0", "/elsewhere", hashlib.sha256(data).hexdigest(), SIZE)
    copy_trace(trace, client, folder / "fetched")
    took, spent = time.perf_counter() - begun, cpu(daemon.pid) - spent
    row(
        f"fetch {SIZE / 1e6:.0f} MB",
        f"{SIZE / 1e6 / took:.0f} MB/s",
        f"daemon {1000 * spent / (SIZE / 1e6):.1f} ms CPU per MB, verified as a whole",
    )
    meanwhile(daemon, client, reply.grants[2], data)


def meanwhile(daemon: DaemonPart, client: Client, grant: Lease, data: bytes) -> None:
    """Status of somebody else while a trace arrives as fast as it can."""
    with daemon.client() as other:
        before = questions(other, 200)
        sender = threading.Thread(target=upload, args=(client, grant, data, LARGEST_CHUNK))
        sender.start()
        during = []
        while sender.is_alive():
            during += questions(other, 5)
        sender.join()
    for what, times in (("alone", before), ("while a trace arrives", during)):
        p99 = statistics.quantiles(times, n=100)[-1]
        row(f"status, {what}", f"p50 {statistics.median(times):.2f} ms", f"p99 {p99:.1f} ms")


def questions(client: Client, count: int) -> list[float]:
    times = []
    for _ in range(count):
        begun = time.perf_counter()
        client.overview()
        times.append(1000.0 * (time.perf_counter() - begun))
    return times


def distance() -> None:
    """Runs of half a second on eight slots, with nothing between worker and daemon but distance."""
    for size in (0, DISTANT_TRACE):
        for delay in (0.0, 0.1):
            with fresh(lease=30.0) as daemon, daemon.client() as client, ExitStack() as stack:
                link = stack.enter_context(slow_line(daemon.endpoint, delay=delay))
                elsewhere = str(daemon.state.parent / "elsewhere")
                options = {"connect": link.endpoint}
                stack.enter_context(worker_for(daemon, 8, "--state", elsewhere, **options))
                client.submit(make_submission("warm", 8, sleep=0.5, size=size))
                eventually(lambda: finished(client, 8), 120.0)
                client.submit(make_submission("far", DISTANT, sleep=0.5, size=size))
                begun = time.perf_counter()
                eventually(lambda: finished(client, 8 + DISTANT), 600.0)
                took = time.perf_counter() - begun
            what = f"0.5 s runs, 8 slots, {1000 * 2 * delay:.0f} ms, traces of {size // 1024} KiB"
            row(what, f"{DISTANT / took:.2f} runs/s", ">= 10 at 200 ms" if not size else "")


def main() -> None:
    with (
        tempfile.TemporaryDirectory(prefix="bench-transport-") as folder,
        fresh() as daemon,
        daemon.client() as client,
    ):
        rates(daemon, client, Path(folder))
    distance()
