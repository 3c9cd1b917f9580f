"""Traces on their way: what parts and digests cost, and what others notice of it.

A real daemon over loopback; the sender is this process. CPU times are of the daemon process. At the
end short runs over a link of 200 ms: a worker elsewhere, behind a line that delays every byte.
"""

import hashlib
import random
import shutil
import threading
import time
from contextlib import ExitStack
from dataclasses import replace
from importlib.metadata import version

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
from tests.benchmarks.bench_daemon import asked, fresh, passed
from tests.benchmarks.measurement import Measurement, Reference, at_least, spread
from tests.chaos.links import relay
from tests.make import make_result, make_submission
from tests.parts import eventually, finished, worker_for

LONG = "short runs over a link of 200 ms"
SIZE = 64 * 2**20
DISTANT, DISTANT_TRACE = 100, 2**20
ME = WorkerInfo("bench-1", "bench", 1, version("scenario-tui"), 1, 0)


def measure():
    """Yield rates of traces, then runs over a distance."""
    with fresh() as daemon, daemon.client() as client:
        yield from rates(daemon, client)
    yield from distance()


def upload(client, grant, data):
    sha256, lease = hashlib.sha256(data).hexdigest(), LeaseRef(grant.run, grant.token)
    for offset in range(0, len(data), PART):
        part = data[offset : offset + PART]
        request = PutRequest(sha256, len(data), offset, part, lease, grant.era)
        assert client.ask(verbs.PUT, request).count == offset + len(part)
    result = make_result(grant.spec, trace=TraceInfo(sha256, len(data), 1))
    done = Completion(ME.id, grant.run, 1, grant.token, result, grant.era)
    client.ask(verbs.COMPLETE, done)


def rates(daemon, client):
    """Yield a trace sent and fetched, and what somebody else notices of it."""
    client.submit(make_submission("c", 2))
    me = replace(ME, era=client.ask(verbs.WELCOME, ME).era)
    first, second = client.ask(verbs.LEASE, LeaseRequest(me, 2)).grants
    data, folder = random.Random(1).randbytes(SIZE), daemon.state.parent
    with passed() as copied:
        (folder / "plain").write_bytes(data)
        shutil.copyfile(folder / "plain", folder / "copy")
    trace = TraceReference("c.0", "/elsewhere", hashlib.sha256(data).hexdigest(), SIZE)
    mega = SIZE / 1e6
    for name, work in (
        ("upload", lambda: upload(client, first, data)),
        ("fetch, verified as a whole:", lambda: copy_trace(trace, client, folder / "fetched")),
    ):
        with passed(daemon.pid) as took:
            work()
        note = f"{mega / took[0]:.0f} MB/s, daemon {1000 * took[1] / mega:.1f} ms CPU per MB"
        beside = Reference("written and copied", copied[0])
        yield Measurement(f"{name} {mega:.0f} MB", took[0], "s", beside, (), note)
    with daemon.client() as other:
        alone = asked("status, alone", other.overview)
        yield alone
        sender = threading.Thread(target=upload, args=(client, second, data))
        sender.start()
        during = []
        while sender.is_alive():
            begun = time.perf_counter()
            other.overview()
            during.append(1e3 * (time.perf_counter() - begun))
        sender.join()
    busy = spread("status, while a trace arrives", during)
    yield replace(busy, reference=Reference("alone", alone.value))


def distance():
    """Runs of half a second on eight slots, with nothing between worker and daemon but distance."""
    for size in (0, DISTANT_TRACE):
        near = None
        for delay in (0.0, 0.1):
            with fresh(lease=30.0) as daemon, daemon.client() as client, ExitStack() as stack:
                link = stack.enter_context(relay(daemon.endpoint, delay=delay))
                elsewhere = str(daemon.state.parent / "elsewhere")
                options = {"connect": link.endpoint}
                stack.enter_context(worker_for(daemon, 8, "--state", elsewhere, **options))
                client.submit(make_submission("warm", 8, sleep=0.5, size=size))
                eventually(lambda: finished(client, 8), 120.0)
                client.submit(make_submission("far", DISTANT, sleep=0.5, size=size))
                with passed() as took:
                    eventually(lambda: finished(client, 8 + DISTANT), 600.0)
            what = f"0.5 s runs, 8 slots, {1000 * 2 * delay:.0f} ms, traces of {size // 1024} KiB"
            goals = (at_least(10.0),) if delay and not size else ()
            yield Measurement(what, DISTANT / took[0], "/s", near, goals)
            near = near or Reference("without a distance", DISTANT / took[0])
