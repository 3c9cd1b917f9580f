"""The dashboard in a terminal: 100,000 runs, keys, bytes over the line, an hour of events.

Real daemons on loopback and the dashboard in a pseudo-terminal, as over SSH; the hour of events
passes under a simulated clock. The CPU for a key is that of all the process does while keys come,
what it asks of the daemon included. Times of the wall suffer from whatever else runs here.
"""

import asyncio
import sqlite3
import statistics
import tempfile
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import psutil

from tests.benchmarks import progress
from tests.benchmarks.bench_daemon import fresh
from tests.benchmarks.measurement import Measurement, Reference, at_most, cpu, spread
from tests.make import make_spec, make_submission, submission_of
from tests.people.terminal.pseudo_terminal import scenario, terminal

LONG = "100 000 runs, minutes of watching a terminal"
MANY, CAMPAIGNS = 100_000, 300
TURNS, KEYS = 20, 50
APART = 0.1
"""Seconds between two keys, in which what a key has caused is drawn."""
QUIET = 10.0
HOUR = 3600
DRAWN = Reference("80x24 drawn each second", 80 * 24 / 1e3)
_MIXED = """
UPDATE run SET state = 'done', outcome = CASE WHEN position % 50 = 0 THEN 'fail' ELSE 'pass' END,
    oracle = 'no-contact', margin = ((position * 7919) % 1000) / 500.0 - 0.2, unit = 'm',
    scenario = 'S' || (position % 7), simulated = 312.5, wall = 8.25, finished_at = 1.0
    WHERE position < {done}
"""


def measure():
    """Yield what each part has to say."""
    for part in (many_runs, line, replay):
        yield from part()
    yield asyncio.run(an_hour())


@contextmanager
def opened(daemon, **size):
    """The dashboard of a daemon, as soon as it can be typed at."""
    with terminal(scenario("tui", "--connect", daemon.endpoint), **size) as shown:
        shown.until("Quit")
        yield shown


def took(shown, keys, seen):
    """Press keys and return how long it takes until something is on the screen [ms]."""
    start = time.perf_counter()
    shown.type(keys)
    while not seen():
        shown.read(0.002)
        if time.perf_counter() > start + 30.0:
            raise TimeoutError(shown.text)
    return 1e3 * (time.perf_counter() - start)


def fill(daemon):
    """Put campaigns into the ledger, one of many runs, most of them done."""
    progress.say(f"{MANY:,} runs, {CAMPAIGNS} campaigns")
    with daemon.client() as client:
        for number in range(CAMPAIGNS - 1):
            client.submit(make_submission(f"small-{number}", 1))
        client.submit(make_submission("large-1", MANY))
    daemon.kill()
    with sqlite3.connect(daemon.state / "ledger.db") as ledger:
        ledger.execute(_MIXED.format(done=MANY - 100))
    daemon.restart()
    daemon.client().close()


def many_runs():
    with fresh() as daemon:
        fill(daemon)
        with opened(daemon, columns=120, rows=40) as shown:
            shown.until("large-1")
            shown.until(lambda: "judging" not in shown.lines[0])
            yield idle("campaigns", shown)
            yield key("a campaign down and up", shown, "jk")
            shown.type("g\r")
            shown.until("1-100 of")
            yield idle("runs", shown)
            yield key("  a run down and up", shown, "jk")
            yield key("  the last page of runs and the first", shown, "Gg")
            yield from turn_pages(shown)
            yield from filters(shown, daemon.pid)
            used = psutil.Process(shown.pid).memory_info().rss / 2**20
            yield Measurement("  its RSS then", used, "MB", None, (at_most(150.0),))
            shown.type("m")
            shown.until("no-contact")
            yield idle("matrix", shown)
            yield key("  a cell right and left", shown, "lh")


def key(name, shown, keys):
    """Press two keys in turns; return the CPU for one."""
    shown.read(2.0)
    before = cpu(shown.pid)
    for number in range(KEYS):
        shown.type(keys[number % 2])
        stay(shown, APART)
    used = 1e3 * (cpu(shown.pid) - before) / KEYS
    return Measurement(name, used, "CPU ms", None, (at_most(20.0),))


def stay(shown, seconds):
    """Read for so long, whatever comes; return how long it was."""
    start = time.monotonic()
    while (left := start + seconds - time.monotonic()) > 0.0:
        shown.read(min(left, 0.5))
    return time.monotonic() - start


def idle(name, shown):
    """Return the share of a core that the dashboard takes while nothing happens."""
    stay(shown, 5.0)
    before = cpu(shown.pid)
    passed = stay(shown, 2.0 * QUIET)
    share = 100.0 * (cpu(shown.pid) - before) / passed
    return Measurement(f"{name}: idle", share, "% of a core", None, (at_most(0.5),))


def turn_pages(shown):
    """Go back and forth over the end of a page."""
    turns = (("k", "1-100 of"), ("j", "101-200 of"))
    while turns[1][1] not in shown.text:
        first = shown.lines[3]
        took(shown, "\x1b[6~", lambda first=first: shown.lines[3] != first)
    before, times = cpu(shown.pid), []
    for number in range(TURNS):
        pressed, page = turns[number % 2]
        times.append(took(shown, pressed, lambda page=page: page in shown.text))
    used = 1e3 * (cpu(shown.pid) - before) / TURNS
    yield spread(f"{MANY:,} runs: the next page", times, at_most(50.0))
    yield Measurement("  CPU of the dashboard for one", used, "CPU ms")


def filters(shown, daemon):
    """Type a filter, all at once, and take it away again."""
    times, used = [], []
    for number in range(TURNS // 2):
        text = f"S{number % 7}"
        before = cpu(shown.pid) + cpu(daemon)
        times.append(took(shown, f"/{text}", _filtered(shown, text)))
        used.append(1e3 * (cpu(shown.pid) + cpu(daemon) - before))
        shown.type("\x1b")
        shown.until(lambda: f"of {MANY}" in shown.lines[1])
        shown.read(0.3)
    yield spread("  filter by text, from the keys to the runs", times, at_most(150.0))
    yield Measurement("  CPU of dashboard and daemon for one", statistics.median(used), "CPU ms")


def _filtered(shown, text):
    return lambda: f"/{text}" in shown.lines[1] and f"of {MANY}" not in shown.lines[1]


def line():
    """Yield what campaigns send to a terminal, at rest and while runs end."""
    with fresh(2) as daemon, daemon.client() as client, opened(daemon) as shown:
        stay(shown, 2.0)
        yield per_second("bytes to the terminal, nothing happens", shown)
        specs = (make_spec(k, sleep=0.4, limit=10.0) for k in range(400))
        client.submit(submission_of("busy-1", *specs))
        shown.until("busy-1")
        yield per_second("  campaigns, 10 events a second", shown)


def replay():
    """Yield what the map of a run sends as it is played, ten frames a second."""
    from tests.people.recorded import record_run

    with tempfile.TemporaryDirectory(prefix="bench-tui-") as folder:
        trace = record_run(Path(folder) / "run.mcap")
        with terminal(scenario("replay", str(trace), "--speed", "0.5")) as shown:
            shown.until("driven")  # it stands still where the run was decided
            shown.type("\x1b[H ")
            shown.until(lambda: "‖" not in shown.lines[0])
            before = cpu(shown.pid)
            yield per_second("  a run from above, 10 frames a second", shown, at_most(40.0))
            used = 1e3 * (cpu(shown.pid) - before) / (10 * QUIET)
            yield Measurement(
                "  CPU for one frame, all included", used, "CPU ms", None, (at_most(5.0),)
            )


def per_second(name, shown, *goals):
    before = shown.sent
    passed = stay(shown, QUIET)
    return Measurement(name, (shown.sent - before) / passed / 1e3, "kB/s", DRAWN, goals)


async def an_hour():
    """Telemetry ten times a second, taken in every second and drawn every ten."""
    from tests.people.dashboard.dash import make_dashboard, press, settle
    from tests.people.fake import FakeDaemon, make_live

    fake = FakeDaemon()
    process, start = psutil.Process(), 0.0
    async with make_dashboard(fake).run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await press(pilot, "enter")
        for second in range(HOUR):
            if second == HOUR // 10:
                start = process.memory_info().rss / 2**20
            fake.now += 1.0
            fake.live = tuple(make_live(7 + k % 3, second + k / 10) for k in range(10))
            fake.rows = tuple(replace(r, simulated=float(second)) for r in fake.rows)
            pilot.app.update_state()
            if second % 10 == 0:
                await pilot.pause(0)
    ended = process.memory_info().rss / 2**20
    beside = Reference("after 6 minutes", start)
    flat = at_most(1.03, of_ratio=True)
    return Measurement("an hour of events: RSS", ended, "MB", beside, (flat,))
