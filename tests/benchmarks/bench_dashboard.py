"""The dashboard of runs: frames of the map and of signals, then memory over the published building.

A robot drives at 10 Hz along the demo's flat, and in building C, and sees 360 laser returns. Eight
signals of 200 parts each with limits, eight doors and a mission, as a run of many minutes sends
them once a second. Ten runs with the pilot, executed by a real daemon, then looked at in a terminal
of 200 x 50, one after the other. Memory is the resident set of the dashboard's own process; the
one that reads traces for it is its reference, and leaves by itself.
"""

import asyncio
import math
import statistics
import time

import psutil

from daemon.campaign import expand, load_campaign
from daemon.model.live_judgement import DoorMotion, LiveJudgement, LiveSignal, SignalLimit
from grammars.model.geometry import Pose2
from scenario_tui.dashboard.run_timeline import live_timeline
from scenario_tui.dashboard.widgets.map_frame import View
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.terminal.limited_terminal import LimitedTerminalApp
from tests.benchmarks import progress
from tests.benchmarks.bench_daemon import fresh
from tests.benchmarks.measurement import Measurement, Reference, at_most, microseconds
from tests.parts import ROOT, eventually, finished
from tests.people.fake import make_row, make_spec
from tests.people.terminal.pseudo_terminal import scenario, terminal

CAMPAIGNS = ROOT / "campaigns"
PUBLISHED = CAMPAIGNS / "ortega2024" / "first.yaml"
BUILDINGS = {"flat": CAMPAIGNS / "demo" / "campaign.yaml", "building C": PUBLISHED}
FRAME = at_most(5.0)
"""CPU [ms] before Textual paints what changed."""
SIZES = ((80, 24), (200, 50))
FRAMES, RETURNS, PARTS, SIGNALS, DOORS = 100, 360, 200, 8, 8
SECONDS = 600.0
"""How long ten runs may take on a busy machine."""


def measure():
    """Yield frames of the map and of signals, then memory."""
    for size in SIZES:
        columns, rows = size
        for building, file in BUILDINGS.items():
            drawn, painted = asyncio.run(map_frames(file, size))["moved"]
            name, beside = f"map, {building}, {columns}x{rows}", Reference("painted", painted)
            yield Measurement(name, drawn, "CPU ms", beside, (FRAME,))
        found = asyncio.run(signal_frames(size))
        still = Reference("the cursor alone", found["cursor"][1])
        name = f"signals that grow, {columns}x{rows}"
        yield Measurement(name, found["grown"][1], "CPU ms", still, (FRAME,))
    yield from ten_runs()


class Alone(LimitedTerminalApp):
    """Shows one widget and nothing else."""

    CSS = "TopView, TimelineView { height: 1fr; }"

    def __init__(self, widget):
        super().__init__()
        self._widget = widget

    def compose(self):
        yield self._widget


async def frames(widget, size, changes):
    """Return medians of what changes cost, without and with the lines after them [ms of CPU]."""
    took = {}
    async with Alone(widget).run_test(size=size):
        for name, change, *arguments in changes:
            alone = microseconds(lambda c=change, a=arguments: c(*a))
            lines = microseconds(lambda: list(map(widget.render_line, range(widget.size.height))))
            took.setdefault(name, []).append((alone / 1e3, (alone + lines) / 1e3))
    return {name: [*map(statistics.median, zip(*each, strict=True))] for name, each in took.items()}


def map_frames(file, size):
    widget = TopView()
    return frames(widget, size, (("moved", widget.show, view) for view in views(file)))


def views(file):
    """Yield what is to be seen of a robot that drives in circles, with a plan and a trail."""
    campaign = expand(load_campaign(file))
    spec = campaign.specs[0]
    scene = next(s for s in campaign.scenes if s.digest == spec.scene)
    resting = tuple(value for obj in scene.objects for value in obj.initial)
    x, y = spec.mission.start.x, spec.mission.start.y
    for step in range(FRAMES):
        now = step / 10.0
        pose = Pose2(x + 0.4 * now, y + 0.3 * math.sin(now), math.sin(0.5 * now))
        bearings = [pose.yaw + math.tau * i / RETURNS for i in range(RETURNS)]
        yield View(
            scene, spec.robot, spec.mission, tuple(q + 0.2 * math.sin(now) for q in resting),
            robot_pose=pose, estimate=pose,
            trail=tuple((x + 0.04 * i, y + 0.3 * math.sin(0.1 * i)) for i in range(step + 1)),
            returns=tuple(
                (pose.x + 2.0 * math.cos(b) + 0.02 * (i % 3), pose.y + 1.5 * math.sin(b))
                for i, b in enumerate(bearings)
            ),
            plan=((pose.x, pose.y), (x + 5.0, y), (x + 5.0, y + 2.0)),
            spread=(0.01, 0.0, 0.01),
        )  # fmt: skip


def signal_frames(size):
    widget, spec = TimelineView(), make_spec(make_row(7), "")
    changes = []
    for judged in map(judgement, range(300, 300 + FRAMES)):
        lines = (live_timeline(judged, spec),)
        changes.append(("grown", widget.show, lines, judged.time))
        changes.append(("cursor", widget.move, judged.time - 20.0))
    return frames(widget, size, changes)


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


def ten_runs():
    """Run the campaign, then look at it."""
    with fresh(2, executor="daemon.run:execute") as daemon, daemon.client() as client:
        progress.say("ten runs of the published building")
        submission = expand(load_campaign(PUBLISHED))
        client.submit(submission)
        count = len(submission.runs)
        eventually(lambda: finished(client, count), SECONDS)
        progress.say("looked at")
        command = scenario("tui", "--connect", daemon.endpoint)
        with terminal(command, columns=200, rows=50) as shown:
            shown.until(submission.campaign)
            yield from look(shown, count)


def look(shown, count):
    """Open one run after the other, as somebody does who looks for the one that failed."""
    yield memory("the list of campaigns", shown)
    shown.type("\r")
    shown.until("S1/pilot/0")
    shown.read(1.0)
    first = opened(shown)
    yield memory("a run open, its map and its signals", shown)
    further = []
    for _ in range(count - 1):
        shown.type("\x1b")
        shown.until(f"of {count}  as submitted")
        shown.type("j")
        shown.read(0.3)
        further.append(opened(shown))
    yield memory(f"  after {count} of them", shown)
    yield Measurement("a run opened, the next ones", min(further), "s", Reference("first", first))


def opened(shown):
    """Open the run under the cursor and return after how long its signals are there [s]."""
    start = time.perf_counter()
    shown.type("\r")
    shown.until(lambda: "loc.error" in shown.text and " wp" in shown.lines[2])
    took = time.perf_counter() - start
    shown.read(1.0)
    return took


def memory(name, shown):
    process = psutil.Process(shown.pid)
    own = process.memory_info().rss / 2**20
    children = [child.memory_info().rss / 2**20 for child in process.children()]
    beside = Reference("who reads traces", sum(children)) if children else None
    return Measurement(f"{name}: RSS", own, "MB", beside, (at_most(150.0),))
