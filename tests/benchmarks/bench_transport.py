"""Traces on their way: what parts and digests cost, and what others notice of it.

A real daemon over loopback; the sender is this process. CPU times are of the daemon process. At the
end short runs over a link of 200 ms: a worker elsewhere, behind a line that delays every byte.
"""

import hashlib
import random
import shutil
import tempfile
import threading
import time
from contextlib import ExitStack
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from daemon.batch.stores import TraceReference, copy_trace
from daemon.model import verbs
from daemon.model.messages import (
    PART,
    Completion,
    LeaseRef,
    LeaseRequest,
    PutRequest,
    WorkerInfo,
)
from daemon.model.spec import TraceInfo
from tests.benchmarks.bench_daemon import fresh
from tests.benchmarks.measurement import Measurement, Reference, cpu, spread
from tests.chaos.links import slow_line
from tests.make import make_result, make_submission
from tests.parts import eventually, finished, worker_for

LONG = "short runs over a link of 200 ms"
SIZE = 64 * 2**20
DISTANT = 100
DISTANT_TRACE = 2**20
ME = WorkerInfo("bench-1", "bench", 1, version("scenario-tui"), 1, 0)


def welcomed(client):
    """The worker as it asks for work."""
    return replace(ME, era=client.ask(verbs.WELCOME, ME).era)


def upload(client, grant, data):
    sha256, lease = hashlib.sha256(data).hexdigest(), LeaseRef(grant.run, grant.token)
    for offset in range(0, len(data), PART):
        part = data[offset : offset + PART]
        request = PutRequest(sha256, len(data), offset, part, lease, grant.era)
        assert client.ask(verbs.PUT, request).count == offset + len(part)
    result = make_result(grant.spec, trace=TraceInfo(sha256, len(data), 1))
    done = Completion(ME.id, grant.run, 1, grant.token, result, grant.era)
    client.ask(verbs.COMPLETE, done)


def rates(daemon, client, folder):
    client.submit(make_submission("c", 2))
    reply = client.ask(verbs.LEASE, LeaseRequest(welcomed(client), 2))
    data = random.Random(1).randbytes(SIZE)
    plain = folder / "plain"
    begun = time.perf_counter()
    plain.write_bytes(data)
    shutil.copyfile(plain, folder / "copy")
    copied = time.perf_counter() - begun
    spent, begun = cpu(daemon.pid), time.perf_counter()
    upload(client, reply.grants[0], data)
    took, spent = time.perf_counter() - begun, cpu(daemon.pid) - spent
    yield Measurement(
        f"upload {SIZE / 1e6:.0f} MB", took, "s",
        Reference("written and copied", copied), (), rate(took, spent),
    )  # fmt: skip
    spent, begun = cpu(daemon.pid), time.perf_counter()
    trace = TraceReference("c.0", "/elsewhere", hashlib.sha256(data).hexdigest(), SIZE)
    copy_trace(trace, client, folder / "fetched")
    took, spent = time.perf_counter() - begun, cpu(daemon.pid) - spent
    yield Measurement(
        f"fetch {SIZE / 1e6:.0f} MB", took, "s", Reference("written and copied", copied), (),
        f"{rate(took, spent)}, verified as a whole",
    )  # fmt: skip
    yield from meanwhile(daemon, client, reply.grants[1], data)


def rate(took, spent):
    mega = SIZE / 1e6
    return f"{mega / took:.0f} MB/s, daemon {1000 * spent / mega:.1f} ms CPU per MB"


def meanwhile(daemon, client, grant, data):
    """Status of somebody else while a trace arrives as fast as it can."""
    with daemon.client() as other:
        alone = spread("status, alone", questions(other, 200))
        sender = threading.Thread(target=upload, args=(client, grant, data))
        sender.start()
        during = []
        while sender.is_alive():
            during += questions(other, 5)
        sender.join()
    yield alone
    busy = spread("status, while a trace arrives", during)
    yield replace(busy, reference=Reference("alone", alone.value))


def questions(client, count):
    times = []
    for _ in range(count):
        begun = time.perf_counter()
        client.overview()
        times.append(1000.0 * (time.perf_counter() - begun))
    return times


def distance():
    """Runs of half a second on eight slots, with nothing between worker and daemon but distance."""
    for size in (0, DISTANT_TRACE):
        near = None
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
            yield Measurement(what, DISTANT / took, "/s", near)
            near = Reference("without a distance", DISTANT / took)


def measure():
    """Yield rates of traces, then runs over a distance."""
    with (
        tempfile.TemporaryDirectory(prefix="bench-transport-") as folder,
        fresh() as daemon,
        daemon.client() as client,
    ):
        yield from rates(daemon, client, Path(folder))
    yield from distance()
