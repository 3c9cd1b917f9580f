"""Signals of a run that goes on: CPU of drawing them anew, and of moving the cursor over them.

Eight signals of 200 parts each with limits, eight doors and a mission, as a run of many minutes
sends them once a second, on the whole of a terminal of 200 x 50. While nothing new came only the
cursor moves.
"""

import math
import statistics
import time

from daemon.model.live_judgement import DoorMotion, LiveJudgement, LiveSignal, SignalLimit
from scenario_tui.dashboard.run_timeline import live_timeline
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.terminal.limited_terminal import LimitedTerminalApp
from tests.benchmarks.measurement import Measurement, Reference, at_most
from tests.people.fake import make_row, make_spec

SIZES = ((80, 24), (200, 50))
FRAMES, PARTS, SIGNALS, DOORS = 40, 200, 8, 8


def judgement(now):
    """Return what a run is judged by at ``now`` [s]."""
    along = [now * part / PARTS for part in range(PARTS)]
    signals, limits = [], (SignalLimit(0.2, "above"),)
    for index in range(SIGNALS):
        low = tuple(0.1 + abs(math.sin(t / (7.0 + index))) for t in along)
        high = tuple(value + 0.02 for value in low)
        signals.append(
            LiveSignal(f"signal-{index}", "m", 0.0, now, low, high, limits, ((3.0, 5.0),), ("it",))
        )
    moves = tuple(
        DoorMotion(now * i / (5 * DOORS), f"door-{i % DOORS}.hinge", i // DOORS % 2 == 0)
        for i in range(5 * DOORS)
    )
    return LiveJudgement("run", now, tuple(signals), (), moves, (now / 3, now / 2), ())


class Signals(LimitedTerminalApp):
    """Shows nothing but signals."""

    CSS = "TimelineView { height: 1fr; }"

    def compose(self):
        """Lay them out."""
        yield TimelineView(id="signals")


def measure():
    """Yield what a new judgement and a cursor that moves cost at each size."""
    import asyncio

    for size in SIZES:
        grown, moved = asyncio.run(costs(size))
        name = f"{size[0]}x{size[1]}"
        beside = Reference("the cursor alone", moved)
        yield Measurement(f"signals that grow, {name}", grown, "CPU ms", beside, (at_most(5.0),))


async def costs(size):
    """Return milliseconds of CPU of a frame: with a new judgement, and with the cursor moved."""
    spec, grown, moved = make_spec(make_row(7), ""), [], []
    async with Signals().run_test(size=size) as pilot:
        view = pilot.app.query_one(TimelineView)
        for frame in range(FRAMES):
            judged = judgement(300.0 + frame)

            def grow(judged=judged):
                view.show((live_timeline(judged, spec),), judged.time)

            def move(judged=judged):
                view.move(judged.time - 20.0)

            grown.append(spent(view, grow))
            moved.append(spent(view, move))
    return statistics.median(grown), statistics.median(moved)


def spent(view, change):
    """Return what a change and the lines of the view after it cost [ms of CPU]."""
    start = time.process_time()
    change()
    for row in range(view.size.height):
        view.render_line(row)
    return 1e3 * (time.process_time() - start)
