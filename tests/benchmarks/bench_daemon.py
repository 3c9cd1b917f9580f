"""The daemon under load: runs through the ledger, submissions, questions, idle cost, many workers.

Real processes over loopback. CPU times are of the daemon process; what waits for the machine is
told as such. ``corridor`` at the end executes real runs with one slot and with two.
"""

from __future__ import annotations

import multiprocessing
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import psutil

from daemon.batch import bus
from daemon.batch.client import Client
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.model.execution import DEFAULT_EXECUTOR
from daemon.model.status import Submission
from tests.chaos.light import Crew, LightWorker
from tests.daemon.batch.harness import DaemonPart, daemon_at, eventually, family, finished
from tests.daemon.batch.samples import make_submission

EMPTY = 3000
QUEUED = 100_000
LARGE = 1_000_000
CAMPAIGNS = 20_000
LEASED = 4000
WORKERS = 400
PROCESSES = 4
RUNS = 20
IDLE = 10.0
QUESTIONS = 300
CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "ortega2024" / "first.yaml"


def row(what: str, value: str, target: str = "") -> None:
    print(f"{what:58} {value:>22} {target}", flush=True)


@contextmanager
def fresh(slots: int = 0, **settings: float | str) -> Iterator[DaemonPart]:
    """A daemon on an empty state directory."""
    with (
        tempfile.TemporaryDirectory(prefix="bench-daemon-") as folder,
        daemon_at(Path(folder) / "state", slots, **settings) as daemon,
    ):
        yield daemon


def cpu(pid: int) -> float:
    """CPU seconds of a process so far."""
    used = psutil.Process(pid).cpu_times()
    return float(used.user + used.system)


def empty_runs() -> None:
    with fresh() as daemon, daemon.client() as client:
        client.submit(make_submission("empty", EMPTY))
        before, start = cpu(daemon.pid), time.monotonic()
        crew = Crew(daemon.endpoint, daemon.state, 4, 16)
        eventually(lambda: finished(client, EMPTY), 120.0)
        took, used = time.monotonic() - start, cpu(daemon.pid) - before
        crew.stop()
    row("empty runs through the ledger, end to end", f"{EMPTY / took:.0f} /s", ">= 300")
    row("  CPU of the daemon for one", f"{1e3 * used / EMPTY:.2f} ms")


def idle() -> None:
    with fresh(2) as daemon, daemon.client() as client:
        client.submit(make_submission("idle", 20))
        eventually(lambda: finished(client, 20))
        time.sleep(1.0)
        before = cpu(daemon.pid)
        time.sleep(IDLE)
        used = (cpu(daemon.pid) - before) / IDLE
        memory = psutil.Process(daemon.pid).memory_full_info()
        row("idle daemon, its worker connected: CPU", f"{100 * used:.2f} %", "< 1 %")
        row("  USS, RSS", f"{memory.uss / 2**20:.0f}, {memory.rss / 2**20:.0f} MB", "< 120 MB")


def large_campaign(runs: int) -> Submission:
    """The example of building C with as many repeats as it takes."""
    campaign = expand(load_campaign(CAMPAIGN))
    repeats = -(-runs // len(campaign.runs))
    specs = tuple(
        replace(spec, repeat=k * len(campaign.runs) + spec.repeat, seed=spec.seed + k)
        for k in range(repeats)
        for spec in campaign.runs
    )
    return replace(campaign, campaign=f"large-{runs}", runs=specs[:runs], reserve=(), fresh=True)


def leasing(endpoint: str, stop: Any, answer: Any) -> None:
    """Lease and complete runs one by one until told to stop; answers with the seconds of leases."""
    took = []
    with bus.open_client(endpoint) as session:
        worker = LightWorker(session, endpoint, "beside", 1)
        while not stop.wait(0.01):
            start = time.perf_counter()
            grants = worker.lease()
            took.append(time.perf_counter() - start)
            for grant in grants:
                worker.complete(grant)
    answer.put(took)


@contextmanager
def leases_beside(daemon: DaemonPart) -> Iterator[None]:
    """Have another process lease runs during the block, and say how long its leases took."""
    context = multiprocessing.get_context("spawn")
    stop, answer = context.Event(), context.Queue()
    process = context.Process(target=leasing, args=(daemon.endpoint, stop, answer))
    process.start()
    try:
        yield
    finally:
        stop.set()
        took = sorted(1e3 * one for one in answer.get())
        process.join()
    last = took[int(0.99 * len(took))]
    row(
        f"  lease beside it: p50, p99 of {len(took)}",
        f"{statistics.median(took):.1f}, {last:.1f} ms",
    )


def peak(pid: int) -> float:
    """The most memory a process has had so far [MiB]."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 2**10


def large(runs: int = LARGE) -> None:
    """What a campaign of a million runs costs, and others meanwhile."""
    with fresh() as daemon, daemon.client() as client:
        client.submit(make_submission("empty", QUEUED))
        submission = large_campaign(runs)
        process = psutil.Process(daemon.pid)
        with leases_beside(daemon):
            start, before = time.monotonic(), process.cpu_times()
            client.submit(submission)
            took, used = time.monotonic() - start, process.cpu_times()
        own = used.user + used.system - before.user - before.system
        read = used.children_user + used.children_system
        read -= before.children_user + before.children_system
        row(f"submit of {runs} runs", f"{took:.1f} s", "< 60 s" if runs == LARGE else "")
        row("  CPU of the daemon; of the process that reads", f"{own:.1f}; {read:.1f} s")
        row("  most memory of the daemon", f"{peak(daemon.pid):.0f} MiB", "< 600 MiB")
        with leases_beside(daemon):
            start = time.monotonic()
            client.cancel(submission.campaign)
            took = time.monotonic() - start
        row(f"cancel of {runs} runs", f"{took:.1f} s")
        with leases_beside(daemon):
            start = time.monotonic()
            client.delete((submission.campaign,))
            took = time.monotonic() - start
            eventually(lambda: daemon.noted("removed"), 600.0)
        row(f"delete of {runs} runs: hidden, gone", f"{took:.2f}, {time.monotonic() - start:.1f} s")
        row("  ledger afterwards", f"{client.disk().ledger / 2**20:.0f} MiB")


def many_campaigns() -> None:
    """What one of thousands of campaigns costs, against all of them."""
    with tempfile.TemporaryDirectory(prefix="bench-daemon-") as folder:
        paths = StatePaths(Path(folder))
        paths.make_folders()
        with LedgerWriter.open(paths) as ledger, ledger.transaction():
            for i in range(CAMPAIGNS):
                ledger.submit(replace(make_submission(f"c{i}", 1), name=f"n{i % 100}"), float(i))
        with LedgerReader.open(paths) as reader:
            row(f"all of {CAMPAIGNS} campaigns", asked(reader.campaigns, 5))
            row("  the newest 500", asked(lambda: reader.campaign_page(limit=500), 20))
            row("  one by its id", asked(lambda: reader.campaign_page(id="c777", limit=1)))
            row("  one by its name", asked(lambda: reader.campaign_page(name="n77", limit=1)))
            row("  the counts of all", asked(reader.counts, 20))


def room_for_leases() -> None:
    """What it takes to see how many leases a worker may get, beside those that others have."""
    with tempfile.TemporaryDirectory(prefix="bench-daemon-") as folder:
        paths = StatePaths(Path(folder))
        paths.make_folders()
        with LedgerWriter.open(paths) as ledger:
            for running, workers in ((100, 1), (LEASED, LEASED // 100)):
                with ledger.transaction():
                    ledger.submit(make_submission(f"c{running}", running), 0.0)
                    for i in range(workers):
                        ledger.lease(f"w{i}", 100, 0.0, holder="a key" if i % 2 else "")
                for words, holder in (("the owner", ""), ("a key", "a key")):
                    took = asked(partial(ledger.room_for_leases, "w2", holder, (50, 2000)))
                    row(f"room for leases of {words}, {running} running: p50, p99", took)


def submit() -> None:
    with fresh() as daemon, daemon.client() as client:
        for runs, target in ((10_000, "<= 2 s"), (QUEUED, "")):
            submission = large_campaign(runs)
            before, start = cpu(daemon.pid), time.monotonic()
            mine = time.process_time()
            client.submit(submission)
            took, used = time.monotonic() - start, cpu(daemon.pid) - before
            mine = time.process_time() - mine
            row(f"submit of {runs} runs of building C", f"{took:.2f} s", target)
            row("  CPU of client, daemon", f"{mine:.2f}, {used:.2f} s")
        size = client.disk().ledger
        row("  ledger afterwards", f"{size / 2**20:.0f} MiB")


def asked(question: Callable[[], object], times: int = QUESTIONS) -> str:
    """Median and 99th percentile of a question [ms]."""
    took = []
    for _ in range(times):
        start = time.perf_counter()
        question()
        took.append(1e3 * (time.perf_counter() - start))
        time.sleep(0.002)
    return f"{statistics.median(took):.2f}, {statistics.quantiles(took, n=100)[98]:.2f} ms"


def _burn(stop: float) -> None:
    while time.monotonic() < stop:
        sum(range(1000))


def busy_questions() -> None:
    with fresh(2, executor=DEFAULT_EXECUTOR) as daemon, daemon.client() as client:
        row("status, quiet: p50, p99", asked(client.overview))
        client.submit(replace(large_campaign(200), campaign="busy"))
        eventually(lambda: client.overview().running == 2, 60.0)
        time.sleep(3.0)
        row("status while runs fill 2 cores: p50, p99", asked(client.overview), "p99 < 50 ms")


def crowd(endpoint: str, number: int, workers: int, ready: object, stop: object) -> None:
    """Sessions of workers that have nothing to do but say that they live, and lease one by one."""
    with ExitStack() as stack:
        crew = [
            LightWorker(stack.enter_context(bus.open_client(endpoint)), endpoint, f"c{number}-{i}")
            for i in range(workers)
        ]
        for worker in crew:
            worker.renew()
        ready.release()  # type: ignore[attr-defined]
        while not stop.wait(0.0):  # type: ignore[attr-defined]
            for worker in crew:
                if stop.wait(10.0 / workers):  # type: ignore[attr-defined]
                    break
                worker.renew()


@contextmanager
def crowded(endpoint: str) -> Iterator[None]:
    """``WORKERS`` sessions in a few processes, each renewing every 10 s."""
    context = multiprocessing.get_context("spawn")
    ready, stop = context.Semaphore(0), context.Event()
    share = WORKERS // PROCESSES
    crew = [
        context.Process(target=crowd, args=(endpoint, i, share, ready, stop))
        for i in range(PROCESSES)
    ]
    for process in crew:
        process.start()
    try:
        for _ in crew:
            assert ready.acquire(timeout=120.0)
        yield
    finally:
        stop.set()
        for process in crew:
            process.join(30.0)
            process.kill()


def scale() -> None:
    with fresh() as daemon, daemon.client() as client:
        for part in range(10):
            client.submit(replace(large_campaign(QUEUED // 10), campaign=f"part-{part}"))
        with crowded(daemon.endpoint):
            eventually(lambda: client.overview().workers == WORKERS)
            before, start = cpu(daemon.pid), time.monotonic()
            time.sleep(5.0)
            used = (cpu(daemon.pid) - before) / (time.monotonic() - start)
            print(f"-- {QUEUED} queued runs, {WORKERS} workers that renew every 10 s")
            row("CPU of the daemon", f"{100 * used:.1f} %")
            row("  USS", f"{psutil.Process(daemon.pid).memory_full_info().uss / 2**20:.0f} MB")
            ask_everything(client)
            with bus.open_client(daemon.endpoint) as session:
                worker = LightWorker(session, daemon.endpoint, "one", 1)
                row("lease of one run: p50, p99", asked(worker.lease))
            submission = replace(large_campaign(1000), campaign="more")
            start = time.monotonic()
            client.submit(submission)
            row("submit of 1000 runs", f"{time.monotonic() - start:.2f} s")


def ask_everything(client: Client) -> None:
    few = 40
    row("overview: p50, p99", asked(client.overview))
    row("campaigns: p50, p99", asked(client.campaigns))
    row("workers: p50, p99", asked(client.workers, few))
    row("first page of 200 runs: p50, p99", asked(lambda: client.runs(), few))
    row(
        "page in the middle of one campaign", asked(lambda: client.runs("part-5", offset=5000), few)
    )
    row("last page of all", asked(lambda: client.runs(offset=QUEUED - 200), few))
    row("sorted by margin", asked(lambda: client.runs(sort="margin"), few))
    row("of one state", asked(lambda: client.runs(state="queued"), few))
    row("of one scenario and system", asked(lambda: client.runs(scenario="S2", sut="pilot"), few))
    row("with a text in them", asked(lambda: client.runs(text="S2/pilot/77"), few))


def overhead(pid: int) -> tuple[float, float]:
    """CPU seconds of the daemon, its worker and the fork server; and of the runs that ended."""
    own = runs = 0.0
    for process in family(pid):
        used = process.cpu_times()
        own += used.user + used.system
        # Runs are children of the fork server; the daemon and the worker have no others yet.
        runs += used.children_user + used.children_system
    return own, runs


def await_runs(client: Client, runs: int) -> None:
    """Wait for the end of runs, asking seldom: to be asked costs, too."""
    while not finished(client, runs):
        time.sleep(0.25)


def efficiency() -> None:
    """Runs of building C with one slot and with two; two cores cannot give more than twice."""
    took = []
    for slots in (1, 2):
        with fresh(slots, executor=DEFAULT_EXECUTOR) as daemon, daemon.client() as client:
            client.submit(replace(large_campaign(2), campaign="warm"))
            await_runs(client, 2)
            before, start = overhead(daemon.pid), time.monotonic()
            client.submit(replace(large_campaign(RUNS), campaign="measured"))
            await_runs(client, RUNS + 2)
            took.append(time.monotonic() - start)
            own, runs = (b - a for a, b in zip(before, overhead(daemon.pid), strict=True))
        row(f"{RUNS} runs of building C, {slots} slots", f"{took[-1]:.1f} s")
        row("  CPU of the runs; of daemon and worker", f"{runs:.1f} s; {100 * own / runs:.1f} %")
    row("scaling efficiency", f"{took[0] / took[1] / 2:.2f}", ">= 0.9 on free cores")


def main() -> None:
    print(f"load {psutil.getloadavg()[0]:.1f} on {psutil.cpu_count()} cores")
    for part in (
        empty_runs,
        idle,
        submit,
        large,
        many_campaigns,
        room_for_leases,
        busy_questions,
        scale,
        efficiency,
    ):
        part()
        assert threading.active_count() < 50
