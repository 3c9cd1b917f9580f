"""The daemon under load: runs through the ledger, submissions, questions, idle cost, many workers.

Real processes over loopback. CPU times are of the daemon process; what waits for the machine is
told as such.
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
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.model.execution import DEFAULT_EXECUTOR
from daemon.model.submission import MOST_RUNS
from tests.benchmarks.measurement import Measurement, Reference, at_least, at_most, cpu, spread
from tests.chaos.light import Crew, LightWorker
from tests.make import make_submission
from tests.parts import ROOT, daemon_at, eventually, family, finished

EMPTY = 3000
QUEUED, LARGE = 100_000, MOST_RUNS
WORKERS, PROCESSES = 400, 4
IDLE = 10.0
QUESTIONS = 300
CORE = Reference("one core", 100.0)
LONG = "200 000 runs, 400 workers"
CAMPAIGN = ROOT / "campaigns" / "ortega2024" / "first.yaml"


def measure():
    """Yield what each part has to say."""
    for part in (empty_runs, idle, submit, large, busy_questions, scale):
        yield from part()
        assert threading.active_count() < 50


@contextmanager
def fresh(slots=0, **settings):
    """A daemon on an empty state directory."""
    with (
        tempfile.TemporaryDirectory(prefix="bench-daemon-") as folder,
        daemon_at(Path(folder) / "state", slots, **settings) as daemon,
    ):
        yield daemon


@contextmanager
def passed(pid=None):
    """Seconds that the block takes, and CPU seconds that a process uses meanwhile."""
    found = []
    start, before = time.monotonic(), cpu(pid) if pid else 0.0
    yield found
    found += [time.monotonic() - start, cpu(pid) - before if pid else 0.0]


def empty_runs():
    with fresh() as daemon, daemon.client() as client:
        client.submit(make_submission("empty", EMPTY))
        with passed(daemon.pid) as took:
            crew = Crew(daemon.endpoint, daemon.state, 4, 16)
            eventually(lambda: finished(client, EMPTY), 120.0)
        crew.stop()
    ended = "empty runs through the ledger, end to end"
    yield Measurement(ended, EMPTY / took[0], "/s", None, (at_least(300.0),))
    yield Measurement("  CPU of the daemon for one", 1e3 * took[1] / EMPTY, "CPU ms")


def idle():
    with fresh(2) as daemon, daemon.client() as client:
        client.submit(make_submission("idle", 20))
        eventually(lambda: finished(client, 20))
        time.sleep(1.0)
        yield share("idle daemon, its worker connected: CPU", daemon, at_most(1.0))
        yield memory(daemon, at_most(120.0))


def share(name, daemon, *goals, note=""):
    """Return the share of a core that a daemon takes for a while."""
    with passed(daemon.pid) as took:
        time.sleep(IDLE)
    return Measurement(name, 100 * took[1] / took[0], "%", CORE, goals, note)


def memory(daemon, *goals):
    found = psutil.Process(daemon.pid).memory_full_info()
    beside = Reference("USS", found.uss / 2**20)
    return Measurement("  its RSS", found.rss / 2**20, "MB", beside, goals)


def large_campaign(runs, name=""):
    """The example of building C with as many repeats as it takes."""
    campaign = expand(load_campaign(CAMPAIGN))
    repeats = -(-runs // len(campaign.runs))
    every = tuple(
        run._replace(repeat=k * len(campaign.runs) + run.repeat, seed=run.seed + k)
        for k in range(repeats)
        for run in campaign.runs
    )
    name = name or f"large-{runs}"
    return replace(campaign, campaign=name, runs=every[:runs], reserve=(), fresh=True)


def submit():
    with fresh() as daemon, daemon.client() as client:
        for runs, goals in ((10_000, (at_most(2.0),)), (QUEUED, ())):
            submission, mine = large_campaign(runs), time.process_time()
            with passed(daemon.pid) as took:
                client.submit(submission)
            mine = f"CPU of the client {time.process_time() - mine:.2f} s"
            yield Measurement(f"submit of {runs} runs", took[0], "s", None, goals, mine)
            whole = Reference("all of it", took[0])
            yield Measurement("  CPU of the daemon", took[1], "CPU s", whole)
        yield Measurement("  ledger afterwards", client.disk().ledger / 2**20, "MiB")


def leasing(endpoint, stop, answer):
    """Lease and complete runs one by one until told to stop; answers with the ms of each."""
    took = []
    with bus.open_client(endpoint) as session:
        worker = LightWorker(session, endpoint, "beside", 1)
        while not stop.wait(0.01):
            start = time.perf_counter()
            with suppress(Unreachable):  # unanswered in time: it took as long as that
                for grant in worker.lease():
                    worker.complete(grant)
            took.append(1e3 * (time.perf_counter() - start))
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
        took = answer.get()
        process.join()
    if took:
        found.append(spread("  lease and result beside it", took))


def large():
    """What the largest campaign there may be costs, and others meanwhile."""
    with fresh() as daemon, daemon.client() as client:
        client.submit(make_submission("empty", QUEUED))
        submission, beside = large_campaign(LARGE), None
        for name, work, goals in (
            ("submit", lambda: client.submit(submission), (at_most(30.0),)),
            ("cancel", lambda: client.cancel(submission.campaign), ()),
            ("delete", lambda: client.delete((submission.campaign,)), ()),
        ):
            with leases_beside(daemon) as leases, passed(daemon.pid) as took:
                work()
            yield Measurement(f"{name} of {LARGE} runs", took[0], "s", beside, goals)
            beside = beside or Reference("the submission", took[0])
            yield Measurement("  CPU of the daemon", took[1], "CPU s", beside)
            yield from leases
        status = Path(f"/proc/{daemon.pid}/status").read_text()
        most = int(status.split("VmHWM:")[1].split()[0]) / 2**10
        yield Measurement("  most memory of the daemon", most, "MiB", None, (at_most(600.0),))
        yield Measurement("  ledger afterwards", client.disk().ledger / 2**20, "MiB")


def asked(name, question, times=QUESTIONS, *goals):
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
        client.submit(large_campaign(200, "busy"))
        eventually(lambda: client.overview().running == 2, 60.0)
        time.sleep(3.0)
        name = "status while runs fill 2 cores"
        busy = asked(name, client.overview, QUESTIONS, at_most(50.0))
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
    each = WORKERS // PROCESSES
    crew = [
        context.Process(target=crowd, args=(endpoint, i, each, ready, stop))
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
            client.submit(large_campaign(QUEUED // 10, f"part-{part}"))
        with crowded(daemon.endpoint):
            eventually(lambda: client.overview().workers == WORKERS)
            load = f"{QUEUED} queued runs, {WORKERS} workers that renew every 10 s"
            yield share("CPU of the daemon", daemon, note=load)
            yield memory(daemon)
            questions = {
                "overview": client.overview,
                "campaigns": client.campaigns,
                "workers": client.workers,
                "first page of 200 runs": lambda: client.runs(),
                "page in the middle": lambda: client.runs("part-5", offset=QUEUED // 20),
                "last page of all": lambda: client.runs(offset=QUEUED - 200),
                "sorted by margin": lambda: client.runs(sort="margin"),
                "of one state": lambda: client.runs(state="queued"),
                "of one scenario and system": lambda: client.runs(scenario="S2", sut="pilot"),
                "with a text in them": lambda: client.runs(text="S2/pilot/77"),
            }
            beside = None
            for name, question in questions.items():
                one = asked(name, question, 40)
                yield replace(one, reference=beside)
                beside = beside or Reference(name, one.value)
            with bus.open_client(daemon.endpoint) as session:
                worker = LightWorker(session, daemon.endpoint, "one", 1)
                yield asked("lease of one run", worker.lease)


def fill_ledger(folder, campaigns):
    """Put so many campaigns of one run into the ledger of a new state directory."""
    paths = StatePaths(Path(folder))
    paths.make_folders()
    one = make_submission("c", 1)
    with LedgerWriter.open(paths) as ledger, ledger.transaction():
        for i in range(campaigns):
            ledger.submit(replace(one, campaign=f"c{i}", name=f"n{i % 100}"), float(i))


def used_by(pid):
    """CPU seconds of the daemon, its worker and the zygote; and of the runs, those that go on too.

    Runs are nice, and children of the zygote, which has the times of those that ended.
    """
    own = runs = 0.0
    for process in family(pid):
        with suppress(psutil.NoSuchProcess):  # a run that has just ended
            used, in_run = process.cpu_times(), process.nice() > 0
            runs += used.children_user + used.children_system
            if in_run:
                runs += used.user + used.system
            else:
                own += used.user + used.system
    return own, runs
