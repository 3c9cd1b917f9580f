"""The dashboard: first paint, 100,000 runs, busy cores, bytes over the line, an hour of events.

Real daemons on loopback and the dashboard in a pseudo-terminal of 80x24, as over SSH; the hour of
events passes under a simulated clock. Times of the wall suffer from whatever else runs here: CPU
of the dashboard's process stands beside them.
"""

import asyncio
import multiprocessing
import sqlite3
import statistics
import tempfile
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import psutil

from tests.benchmarks.bench_daemon import fresh
from tests.benchmarks.measurement import Measurement, Reference, at_most, cpu, spread
from tests.make import make_spec, make_submission, submission_of
from tests.parts import eventually, finished
from tests.people.terminal.pseudo_terminal import scenario, terminal

LONG = "100 000 runs, minutes of watching a terminal"
MANY = 100_000
STARTS = 7
TURNS = 20
QUIET = 10.0
HOUR = 3600
DRAWN = Reference("80x24 drawn each second", 80 * 24 / 1e3)
_STROKE = 100
"""Bytes that a cursor which moved sends at least; an age that grew sends less."""
_MIXED = """
UPDATE run SET state = 'done', outcome = CASE WHEN position % 50 = 0 THEN 'fail' ELSE 'pass' END,
    oracle = 'no-contact', margin = ((position * 7919) % 1000) / 500.0 - 0.2, unit = 'm',
    scenario = 'S' || (position % 7), simulated = 312.5, wall = 8.25, finished_at = 1.0
    WHERE position < {done}
"""


def measure():
    """Yield what each part has to say."""
    for part in (first_paint, many_runs, busy_cores, line, live_map):
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


def first_paint():
    with fresh(slots=1) as daemon, daemon.client() as client:
        client.submit(make_submission("small-1", 5))
        eventually(lambda: finished(client, 5))
        stages = {"connecting": [], "Quit": [], "small-1": []}
        for _ in range(STARTS):
            start = time.perf_counter()
            with terminal(scenario("tui", "--connect", daemon.endpoint)) as shown:
                for seen, found in stages.items():
                    shown.until(seen)
                    found.append((time.perf_counter() - start, cpu(shown.pid)))
        names = ("an answer", "the first screen", "campaigns on it")
        for name, found in zip(names, stages.values(), strict=True):
            wall, used = (statistics.median(each) for each in zip(*found, strict=True))
            yield Measurement(f"exec to {name}", wall, "s", Reference("its CPU s", used))


def large(daemon):
    """Put a campaign of many runs into the ledger, most of them done."""
    with daemon.client() as client:
        client.submit(make_submission("large-1", MANY))
    daemon.kill()
    with sqlite3.connect(daemon.state / "ledger.db") as ledger:
        ledger.execute(_MIXED.format(done=MANY - 100))
    daemon.restart()
    daemon.client().close()


def many_runs():
    with fresh(slots=0) as daemon:
        large(daemon)
        with opened(daemon) as shown:
            shown.until("large-1")
            shown.type("\r")
            shown.until("1-100 of")
            yield from turn_pages(shown)
            yield from filters(shown, daemon.pid)
            yield from sorts(shown)
            used = psutil.Process(shown.pid).memory_info().rss / 2**20
            yield Measurement("  its RSS then", used, "MB", None, (at_most(150.0),))


def turn_pages(shown):
    """Go back and forth over the end of a page, then by screens inside of one."""
    turns = (("k", "1-100 of"), ("j", "101-200 of"))
    while turns[1][1] not in shown.text:
        shown.type("\x1b[6~")
        shown.read(0.3)
    before, times = cpu(shown.pid), []
    for number in range(TURNS):
        key, page = turns[number % 2]
        times.append(took(shown, key, lambda page=page: page in shown.text))
    used = 1e3 * (cpu(shown.pid) - before) / TURNS
    yield spread(f"{MANY:,} runs: the next page", times, at_most(50.0))
    yield Measurement("  CPU of the dashboard for one", used, "CPU ms")
    times = []
    for _ in range(TURNS):
        first = shown.lines[3][:20]
        times.append(took(shown, "\x1b[6~", lambda first=first: first not in shown.lines[3]))
        shown.read(0.2)
        times.append(took(shown, "\x1b[5~", lambda first=first: first in shown.lines[3]))
        shown.read(0.2)
    yield spread("  page down and up inside a page", times, at_most(50.0))


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
    return lambda: f"/{text}" in shown.lines[1] and " of 14" in shown.lines[1]


def sorts(shown):
    times = []
    for name in ("outcome", "margin", "oracle"):
        times.append(took(shown, ">", lambda name=name: _sorted(shown.lines[1], name)))
        shown.read(0.3)
    yield Measurement("  sorted by another column, slowest", max(times), "ms")


def _sorted(trail, name):
    return f"by {name}" in trail and "1-100 of" in trail


def _burn(stop):
    while time.monotonic() < stop:
        sum(range(1000))


def busy_cores():
    with fresh(slots=0) as daemon:
        with daemon.client() as client:
            client.submit(make_submission("rows-1", 200))
        with opened(daemon) as shown:
            shown.until("rows-1")
            shown.type("\r")
            shown.until("1-100 of")
            shown.read(1.0)
            quiet = spread("a key to its paint, quiet", strokes(shown))
            yield quiet
            stop = time.monotonic() + 12.0
            burners = [multiprocessing.Process(target=_burn, args=(stop,)) for _ in range(2)]
            for burner in burners:
                burner.start()
            time.sleep(0.5)
            busy = spread("  while 2 cores are busy at nice 0", strokes(shown), at_most(100.0))
            yield replace(busy, reference=Reference("quiet", quiet.value))
            for burner in burners:
                burner.kill()
                burner.join()


def strokes(shown):
    """Move the cursor up and down [ms each]."""
    times = []
    for number in range(2 * TURNS):
        enough = len(shown.raw) + _STROKE
        times.append(took(shown, "jk"[number % 2], lambda enough=enough: len(shown.raw) > enough))
        shown.read(0.05)
    return times


def line():
    with fresh(slots=2) as daemon, daemon.client() as client:
        client.submit(make_submission("small-1", 5))
        eventually(lambda: finished(client, 5))
        with opened(daemon) as shown:
            shown.until("small-1")
            shown.read(2.0)
            yield per_second("bytes to the terminal, nothing happens", shown)
            events = (make_spec(k, sleep=0.4, limit=10.0) for k in range(400))
            client.submit(submission_of("busy-1", *events))
            shown.read(2.0)
            yield per_second("  campaigns, 10 events a second", shown)
            shown.type("\x1b[A\r")
            shown.until("verdict")
            shown.read(1.0)
            yield per_second("  its runs", shown)


def live_map():
    """The map of a run as it is played, ten frames a second."""
    from tests.people.recorded import record_run

    with tempfile.TemporaryDirectory(prefix="bench-tui-") as folder:
        trace = record_run(Path(folder) / "run.mcap")
        with terminal(scenario("replay", str(trace), "--speed", "0.5")) as shown:
            shown.until("0.5x")
            shown.read(1.0)
            before = cpu(shown.pid)
            yield per_second("  a run from above, 10 frames a second", shown, at_most(40.0))
            used = 1e3 * (cpu(shown.pid) - before) / (10 * QUIET)
            yield Measurement(
                "  CPU for one frame, all included", used, "CPU ms", None, (at_most(5.0),)
            )


def per_second(name, shown, *goals):
    before, start = shown.sent, time.monotonic()
    while time.monotonic() < start + QUIET:
        shown.read(0.5)
    sent = (shown.sent - before) / (time.monotonic() - start)
    return Measurement(name, sent / 1e3, "kB/s", DRAWN, goals)


async def an_hour():
    """Telemetry ten times a second, taken in every second and drawn every ten."""
    from tests.people.dashboard.inline import make_dashboard, press, settle
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
