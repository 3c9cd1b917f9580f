"""The daemon under load: runs through the ledger, submissions, questions, idle cost, many workers.

Real processes over loopback. CPU times are of the daemon process; what waits for the machine is
told as such. At the end real runs are executed with one slot and with two.
"""

import multiprocessing
import tempfile
import threading
import time
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import psutil

from daemon.batch import bus
from daemon.batch.errors import Unreachable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.model.execution import DEFAULT_EXECUTOR
from daemon.model.submission import MOST_RUNS
from tests.benchmarks.measurement import Measurement, Reference, at_least, at_most, cpu, spread
from tests.chaos.light import Crew, LightWorker
from tests.make import make_submission
from tests.parts import daemon_at, eventually, family, finished

EMPTY = 3000
QUEUED = 100_000
LARGE = MOST_RUNS
CAMPAIGNS = 20_000
WORKERS = 400
PROCESSES = 4
RUNS = 20
IDLE = 10.0
QUESTIONS = 300
CORE = Reference("one core", 100.0)
LONG = "200 000 runs, 400 workers"
CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "ortega2024" / "first.yaml"


@contextmanager
def fresh(slots=0, **settings):
    """A daemon on an empty state directory."""
    with (
        tempfile.TemporaryDirectory(prefix="bench-daemon-") as folder,
        daemon_at(Path(folder) / "state", slots, **settings) as daemon,
    ):
        yield daemon


def empty_runs():
    with fresh() as daemon, daemon.client() as client:
        client.submit(make_submission("empty", EMPTY))
        before, start = cpu(daemon.pid), time.monotonic()
        crew = Crew(daemon.endpoint, daemon.state, 4, 16)
        eventually(lambda: finished(client, EMPTY), 120.0)
        took, used = time.monotonic() - start, cpu(daemon.pid) - before
        crew.stop()
    ended = "empty runs through the ledger, end to end"
    yield Measurement(ended, EMPTY / took, "/s", None, (at_least(300.0),))
    yield Measurement("  CPU of the daemon for one", 1e3 * used / EMPTY, "CPU ms")


def idle():
    with fresh(2) as daemon, daemon.client() as client:
        client.submit(make_submission("idle", 20))
        eventually(lambda: finished(client, 20))
        time.sleep(1.0)
        before = cpu(daemon.pid)
        time.sleep(IDLE)
        used = (cpu(daemon.pid) - before) / IDLE
        memory = psutil.Process(daemon.pid).memory_full_info()
        yield Measurement(
            "idle daemon, its worker connected: CPU", 100 * used, "%", CORE, (at_most(1.0),)
        )
        yield Measurement(
            "  its RSS", memory.rss / 2**20, "MB", Reference("USS", memory.uss / 2**20),
            (at_most(120.0),),
        )  # fmt: skip


def large_campaign(runs):
    """The example of building C with as many repeats as it takes."""
    campaign = expand(load_campaign(CAMPAIGN))
    repeats = -(-runs // len(campaign.runs))
    every = tuple(
        run._replace(repeat=k * len(campaign.runs) + run.repeat, seed=run.seed + k)
        for k in range(repeats)
        for run in campaign.runs
    )
    return replace(campaign, campaign=f"large-{runs}", runs=every[:runs], reserve=(), fresh=True)


def leasing(endpoint, stop, answer):
    """Lease and complete runs one by one until told to stop; answers with the seconds of each."""
    took = []
    with bus.open_client(endpoint) as session:
        worker = LightWorker(session, endpoint, "beside", 1)
        while not stop.wait(0.01):
            start = time.perf_counter()
            with suppress(Unreachable):  # unanswered in time: it took as long as that
                for grant in worker.lease():
                    worker.complete(grant)
            took.append(time.perf_counter() - start)
    answer.put(took)


@contextmanager
def leases_beside(daemon):
    """Have another process lease runs during the block; afterwards the list says how long for."""
    context = multiprocessing.get_context("spawn")
    stop, answer = context.Event(), context.Queue()
    process = context.Process(target=leasing, args=(daemon.endpoint, stop, answer))
    process.start()
    found = []
    try:
        yield found
    finally:
        stop.set()
        took = sorted(1e3 * one for one in answer.get())
        process.join()
    if took:
        found.append(spread("  lease and result beside it", took))


def peak(pid):
    """The most memory a process has had so far [MiB]."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 2**10


def large(runs=LARGE):
    """What the largest campaign there may be costs, and others meanwhile."""
    with fresh() as daemon, daemon.client() as client:
        client.submit(make_submission("empty", QUEUED))
        submission = large_campaign(runs)
        process = psutil.Process(daemon.pid)
        with leases_beside(daemon) as beside:
            start, before = time.monotonic(), process.cpu_times()
            client.submit(submission)
            took, used = time.monotonic() - start, process.cpu_times()
        own = used.user + used.system - before.user - before.system
        goals = (at_most(30.0),) if runs == LARGE else ()
        yield Measurement(f"submit of {runs} runs", took, "s", None, goals)
        submitting = Reference("the submission", took)
        yield Measurement("  CPU of the daemon", own, "CPU s", submitting)
        most = peak(daemon.pid)
        yield Measurement("  most memory of the daemon", most, "MiB", None, (at_most(600.0),))
        yield from beside
        with leases_beside(daemon) as beside:
            start = time.monotonic()
            client.cancel(submission.campaign)
            took = time.monotonic() - start
        yield Measurement(f"cancel of {runs} runs", took, "s", submitting)
        yield from beside
        with leases_beside(daemon) as beside:
            start = time.monotonic()
            client.delete((submission.campaign,))
            took = time.monotonic() - start
        yield Measurement(f"delete of {runs} runs", took, "s", submitting)
        yield from beside
        yield Measurement("  ledger afterwards", client.disk().ledger / 2**20, "MiB")


def many_campaigns():
    """What one of thousands of campaigns costs, against all of them."""
    with tempfile.TemporaryDirectory(prefix="bench-daemon-") as folder:
        paths = StatePaths(Path(folder))
        paths.make_folders()
        with LedgerWriter.open(paths) as ledger, ledger.transaction():
            for i in range(CAMPAIGNS):
                ledger.submit(replace(make_submission(f"c{i}", 1), name=f"n{i % 100}"), float(i))
        with LedgerReader.open(paths) as reader:
            everything = asked(f"all of {CAMPAIGNS} campaigns", reader.campaigns, 5)
            yield everything
            beside = Reference("all", everything.value)
            for name, question, times in (
                ("  the newest 500", lambda: reader.campaign_page(limit=500), 20),
                ("  one by its id", lambda: reader.campaign_page(id="c777", limit=1), QUESTIONS),
                ("  one by its name", lambda: reader.campaign_page(name="n77", limit=1), QUESTIONS),
                ("  the counts of all", reader.counts, 20),
            ):
                yield replace(asked(name, question, times), reference=beside)


def submit():
    with fresh() as daemon, daemon.client() as client:
        for runs, goals in ((10_000, (at_most(2.0),)), (QUEUED, ())):
            submission = large_campaign(runs)
            before, start = cpu(daemon.pid), time.monotonic()
            mine = time.process_time()
            client.submit(submission)
            took, used = time.monotonic() - start, cpu(daemon.pid) - before
            mine = time.process_time() - mine
            name = f"submit of {runs} runs of building C"
            client_cpu = f"CPU of the client {mine:.2f} s"
            yield Measurement(name, took, "s", None, goals, client_cpu)
            yield Measurement("  CPU of the daemon", used, "CPU s", Reference("all of it", took))
        yield Measurement("  ledger afterwards", client.disk().ledger / 2**20, "MiB")


def asked(name, question, times=QUESTIONS, goals=()):
    """Ask a question many times."""
    took = []
    for _ in range(times):
        start = time.perf_counter()
        question()
        took.append(1e3 * (time.perf_counter() - start))
        time.sleep(0.002)
    return spread(name, took, *goals)


def busy_questions():
    with fresh(2, executor=DEFAULT_EXECUTOR) as daemon, daemon.client() as client:
        quiet = asked("status, quiet", client.overview)
        yield quiet
        client.submit(replace(large_campaign(200), campaign="busy"))
        eventually(lambda: client.overview().running == 2, 60.0)
        time.sleep(3.0)
        busy = asked("status while runs fill 2 cores", client.overview, goals=(at_most(50.0),))
        yield replace(busy, reference=Reference("quiet", quiet.value))


def crowd(endpoint, number, workers, ready, stop):
    """Sessions of workers that have nothing to do but say that they live, and lease one by one."""
    with ExitStack() as stack:
        crew = [
            LightWorker(stack.enter_context(bus.open_client(endpoint)), endpoint, f"c{number}-{i}")
            for i in range(workers)
        ]
        for worker in crew:
            worker.renew()
        ready.release()
        while not stop.wait(0.0):
            for worker in crew:
                if stop.wait(10.0 / workers):
                    break
                worker.renew()


@contextmanager
def crowded(endpoint):
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


def scale():
    with fresh() as daemon, daemon.client() as client:
        for part in range(10):
            client.submit(replace(large_campaign(QUEUED // 10), campaign=f"part-{part}"))
        with crowded(daemon.endpoint):
            eventually(lambda: client.overview().workers == WORKERS)
            before, start = cpu(daemon.pid), time.monotonic()
            time.sleep(5.0)
            used = (cpu(daemon.pid) - before) / (time.monotonic() - start)
            load = f"{QUEUED} queued runs, {WORKERS} workers that renew every 10 s"
            yield Measurement("CPU of the daemon", 100 * used, "%", CORE, (), load)
            memory = psutil.Process(daemon.pid).memory_full_info()
            yield Measurement(
                "  its RSS", memory.rss / 2**20, "MB", Reference("USS", memory.uss / 2**20)
            )
            yield from ask_everything(client)
            with bus.open_client(daemon.endpoint) as session:
                worker = LightWorker(session, daemon.endpoint, "one", 1)
                yield asked("lease of one run", worker.lease)
            submission = replace(large_campaign(1000), campaign="more")
            start = time.monotonic()
            client.submit(submission)
            yield Measurement("submit of 1000 runs", time.monotonic() - start, "s")


def ask_everything(client):
    few = 40
    overview = asked("overview", client.overview)
    yield overview
    beside = Reference("overview", overview.value)
    questions = {
        "campaigns": client.campaigns,
        "workers": client.workers,
        "first page of 200 runs": lambda: client.runs(),
        "page in the middle of one campaign": lambda: client.runs("part-5", offset=5000),
        "last page of all": lambda: client.runs(offset=QUEUED - 200),
        "sorted by margin": lambda: client.runs(sort="margin"),
        "of one state": lambda: client.runs(state="queued"),
        "of one scenario and system": lambda: client.runs(scenario="S2", sut="pilot"),
        "with a text in them": lambda: client.runs(text="S2/pilot/77"),
    }
    for name, question in questions.items():
        yield replace(asked(name, question, few), reference=beside)


def overhead(pid):
    """CPU seconds of the daemon, its worker and the zygote; and of the runs that ended."""
    own = runs = 0.0
    for process in family(pid):
        used = process.cpu_times()
        own += used.user + used.system
        # Runs are children of the zygote; the daemon and the worker have no others yet.
        runs += used.children_user + used.children_system
    return own, runs


def await_runs(client, runs):
    """Wait for the end of runs, asking seldom: to be asked costs, too."""
    while not finished(client, runs):
        time.sleep(0.25)


def efficiency():
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
        beside = Reference("CPU of the runs", runs)
        yield Measurement(f"{RUNS} runs of building C, {slots} slots", took[-1], "s", beside)
        yield Measurement("  CPU of daemon and worker", own, "CPU s", beside)
    yield Measurement(
        "runs a second, two slots", RUNS / took[1], "/s",
        Reference("twice those of one", 2 * RUNS / took[0]), (at_least(0.9, of_ratio=True),),
    )  # fmt: skip


def measure():
    """Yield what each part has to say."""
    for part in (
        empty_runs, idle, submit, large, many_campaigns, busy_questions, scale,
        efficiency,
    ):  # fmt: skip
        yield from part()
        assert threading.active_count() < 50
