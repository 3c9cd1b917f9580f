"""The live map: CPU of a frame, and bytes a second to a terminal while the robot moves.

A robot drives at 10 Hz along the demo's flat, or in building C of Ortega et al., and sees 360 laser
returns; the dashboard's widget shows it in a pseudo-terminal.
"""

import math
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from daemon.campaign import expand, load_campaign
from grammars.model.geometry import Pose2
from scenario_tui.dashboard.widgets.map_frame import View
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.terminal.limited_terminal import LimitedTerminalApp
from tests.benchmarks.measurement import Measurement, Reference, at_most
from tests.people.terminal.pseudo_terminal import terminal

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
BUILDINGS = {"flat": "demo/campaign.yaml", "building C": "ortega2024/first.yaml"}
FRAME = at_most(5.0)
"""CPU of a frame [ms] before Textual paints what changed."""
LINE = {
    "flat": {80: 20.0, 120: 45.0, 200: 65.0},
    "building C": {80: 2.0, 120: 4.0, 200: 6.0},
}
"""Bytes to terminals by their columns [kB/s]: a third more than was measured."""
SECONDS, RATE, RETURNS = 10.0, 10.0, 360


def views(building, count):
    """Return what is to be seen of a robot that drives in circles, with a plan and a trail."""
    campaign = expand(load_campaign(CAMPAIGNS / BUILDINGS[building]))
    spec = campaign.specs[0]
    scene = next(s for s in campaign.scenes if s.digest == spec.scene)
    resting = tuple(value for obj in scene.objects for value in obj.initial)
    still = View(scene, spec.robot, spec.mission, resting)
    x, y = spec.mission.start.x, spec.mission.start.y
    found = []
    for step in range(count):
        now = step / RATE
        pose = Pose2(x + 0.4 * now, y + 0.3 * math.sin(now), math.sin(0.5 * now))
        bearings = [pose.yaw + math.tau * i / RETURNS for i in range(RETURNS)]
        seen = tuple(
            (pose.x + 2.0 * math.cos(b) + 0.02 * (i % 3), pose.y + 1.5 * math.sin(b))
            for i, b in enumerate(bearings)
        )
        trail = tuple((x + 0.04 * i, y + 0.3 * math.sin(0.1 * i)) for i in range(step + 1))
        plan = ((pose.x, pose.y), (x + 5.0, y), (x + 5.0, y + 2.0))
        joints = tuple(q + 0.2 * math.sin(now) for q in resting)
        found.append(
            replace(
                still,
                joints=joints,
                robot_pose=pose,
                estimate=pose,
                trail=trail,
                returns=seen,
                plan=plan,
                spread=(0.01, 0.0, 0.01),
            )
        )
    return found


class Map(LimitedTerminalApp):
    """Shows views one after the other at 10 Hz, then writes what they cost into a file."""

    CSS = "TopView { height: 1fr; }"

    def __init__(self, building, zoom, report):
        super().__init__()
        self._zooms, self._report = zoom, report
        self._views = views(building, int(SECONDS * RATE))
        self._spent = 0.0

    def compose(self):
        """Nothing but the map."""
        yield TopView()

    def on_mount(self):
        """Begin once the first picture is there."""
        for _ in range(self._zooms):
            self.query_one(TopView).zoom()
        self.set_timer(0.5, self._begin)

    def _begin(self):
        self._begun = time.process_time()
        self._shown = 0
        self._report.write_text("begun")
        self.set_interval(1.0 / RATE, self._step)

    def _step(self):
        if self._shown == len(self._views):
            frame = (time.process_time() - self._begun) / self._shown
            self._report.write_text(f"{self._spent / self._shown} {frame}")
            self.exit()
            return
        before = time.process_time()
        self.query_one(TopView).show(self._views[self._shown])
        self._spent += time.process_time() - before
        self._shown += 1


def shown(building, zoom, columns, rows):
    """Run the map in a terminal of its own and yield what it costs."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report"
        command = [sys.executable, "-m", "tests.benchmarks.bench_tui_map"]
        command += [building, str(zoom), str(report)]
        with terminal(command, columns=columns, rows=rows) as screen:
            screen.until(report.exists)
            before = screen.sent
            screen.wait()
            sent = screen.sent - before
        drawn, frame = map(float, report.read_text().split())
    name = f"{building}, {columns}x{rows}, zoom {2**zoom}"
    painted = Reference("with paint", 1e3 * frame)
    yield Measurement(f"{name}: a frame drawn", 1e3 * drawn, "CPU ms", painted, (FRAME,))
    goals = () if zoom else (at_most(LINE[building][columns]),)
    yield Measurement("  bytes to the terminal", sent / SECONDS / 1e3, "kB/s", None, goals)


def measure():
    """Measure a flat and a large building, in small terminals and large ones, near and far."""
    sizes = ((0, 80, 24), (1, 80, 24), (0, 120, 40), (0, 200, 50))
    for building in BUILDINGS:
        for zoom, columns, rows in sizes:
            yield from shown(building, zoom, columns, rows)


if __name__ == "__main__":
    Map(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])).run()
