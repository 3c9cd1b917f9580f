"""Ways through the screen of a run, recorded or under way: ``journeys/run-NAME.txt`` tells each."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from textual.events import MouseScrollDown, MouseScrollUp

from daemon.batch.client import read_snapshot
from daemon.model.live_judgement import LiveJudgement, LogLine
from daemon.model.live_view import to_centimetres
from daemon.model.verdicts import Outcome, RunState
from grammars.model.geometry import Pose2
from grammars.text import codec
from scenario_tui.dashboard.playback import Playback, open_playback
from scenario_tui.dashboard.screens.compare import CompareScreen
from scenario_tui.dashboard.screens.replay import ReplayScreen
from scenario_tui.dashboard.screens.standalone import StandaloneApp
from scenario_tui.dashboard.widgets.timeline import TimelineView
from scenario_tui.dashboard.widgets.top_view import TopView
from tests.people.dashboard.daemons import RecordedDaemon, RepeatingDaemon
from tests.people.dashboard.journeys import LOOK, Journey, follow, has, opened, resized
from tests.people.fake import CAMPAIGN, WAITING, FakeDaemon, make_judgement, make_live
from tests.people.recorded import HIT, record_run

RUN, RUNNING = f"{CAMPAIGN}.5", f"{CAMPAIGN}.7"
WIDE = (120, 40)


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    folder = tmp_path_factory.mktemp("traces")
    record_run(folder / "near.mcap", speed=0.1)
    return record_run(folder / "run.mcap")


def starting(_):
    return FakeDaemon(live=(make_live(7, waiting=WAITING),))


def usual(_):
    return FakeDaemon()


def replay(begin=HIT, *, judged=True):
    """A replay from a moment on of the run, as if it had not been judged if need be."""

    def app(trace):
        playback = open_playback(trace)
        shown = playback if judged else Playback(playback.trace, (), {}, {})
        return StandaloneApp(ReplayScreen(shown, begin, clock=lambda: 0.0))

    return app


def both(trace):
    """Two runs beside each other."""
    far, near = open_playback(trace), open_playback(trace.with_name("near.mcap"))
    return StandaloneApp(CompareScreen(far, near, clock=lambda: 0.0))


def wheel(kind):
    """An action: the wheel is turned above the map."""

    def turn(dash):
        return dash.pilot._post_mouse_events([kind], dash.one(TopView), offset=(5, 5))

    return kind.__name__, turn


def fifty_times_as_fast(dash):
    dash.screen.transport.speed = 50.0


def middle_clicked(dash):
    signals = dash.one(TimelineView)
    return dash.pilot.click(signals, offset=((27 + signals.size.width - 1) // 2, 4))


def repeating(trace):
    return RepeatingDaemon(trace.with_name("repeated.mcap"))


def told(name, *arguments, **changes):
    """An action: the daemon is told to do something."""
    return name, lambda dash: getattr(dash.fake, name)(*arguments, **changes)


def heard(*lives, **judgement):
    """An action: who watches the run hears of it, and of what it is judged."""

    def hear(dash):
        for live in lives:
            dash.fake.watchers[RUNNING](live)
        if judgement:
            dash.fake.judged[RUNNING] = make_judgement(**judgement)

    return "news", hear


def running(_):
    return FakeDaemon(live=tuple(make_live(7, float(t)) for t in np.arange(0.0, 61.0, 2.0)))


def judged(_, **judgement):
    fake = running(None)
    fake.judged[RUNNING] = make_judgement(**judgement)
    return fake


def touching(_):
    return judged(None, contact=True)


def broken(dash):
    """It is not judged any more, and goes on."""
    line = LogLine(60.0, "oracles", "not judged any more while it runs: it broke", "error")
    dash.fake.judged[RUNNING] = LiveJudgement(RUNNING, 60.0, (), (), (), (), (line,))
    dash.fake.watchers[RUNNING](make_live(7, 62.0))


def detailed():
    """What is told of a run to who looks at it alone."""
    live = make_live(7, 20.0)
    details = {
        "spread": (0.04, 0.0, 0.04), "returns": (300, 100, 310, 110),
        "plan": (400, 200, 800, 100), "contacts": (600, 300),
    }  # fmt: skip
    return replace(live, snapshot=replace(live.snapshot, **details))


def astray(far):
    """Its system takes the robot to be anywhere."""

    def hear(dash):
        lost = make_live(7, 61.0)
        points = to_centimetres(np.array([(far, -far), (-far, 0.0), (1.0, 2.0)] * 12))
        lost = replace(lost, snapshot=replace(
            lost.snapshot, estimate=Pose2(far, -far, far), spread=(far, 0.0, far), plan=points
        ))  # fmt: skip
        dash.app.tracks.add(read_snapshot(codec.to_json(lost)))

    return f"{far} m away", hear


def passes(seconds):
    """An action: time passes in what is played."""

    def go(dash):
        dash.screen.clock = lambda: seconds
        dash.screen.tick()

    return f"{seconds} s", go


def become(state):
    return lambda dash: tuple(
        replace(row, state=state) if row.id == RUNNING else row for row in dash.fake.rows
    )


class Ending(RecordedDaemon):
    """Run 7 goes on until it is over, then it is the recorded one."""

    indices = (7,)


def ending(trace):
    fake = Ending(trace)
    fake.live = tuple(make_live(7, float(t)) for t in range(10))
    fake.judged[RUNNING] = make_judgement(time=9.0)
    return fake


def passed(trace):
    fake = FakeDaemon()
    fake.rows = (replace(fake.rows[0], trace=str(trace)), *fake.rows[1:])
    return fake


def lost(columns, rows, index):
    """Ask everything of a run of which there is no recording."""
    return [resized(columns, rows), opened("run", f"{CAMPAIGN}.{index}"), "!tab space n right z p"]


JOURNEYS = {
    "verdicts": Journey([LOOK, "down", "left enter", "tab", "N tab"], RecordedDaemon, run=RUN),
    "again": Journey(
        [LOOK, "home right", told("judge_again"), told("become", RunState.QUEUED),
         told("execute", speed=0.1), "end", told("become", RunState.RUNNING)],
        repeating, WIDE, RUN,
    ),
    "another-attempt": Journey(
        [has(live=(make_live(7, 20.0), make_live(7, 60.0))), has(rows=become(RunState.QUEUED)),
         has(rows=become(RunState.RUNNING))],
        usual, WIDE, RUNNING,
    ),
    "played": Journey(
        [passes(0.0), "home plus space tab tab", passes(1.0), "H", "z z", "L K", "F"],
        RecordedDaemon, run=RUN,
    ),
    "without-recordings": Journey(
        [*lost(80, 24, 0), *lost(80, 24, 7), *lost(40, 10, 8), *lost(120, 40, 9)],
        usual,
    ),
    "compared": Journey(
        [LOOK, opened("runs", CAMPAIGN), "j j j j j C", "j C", "escape", opened("run", RUN), "C",
         "C"],
        RecordedDaemon, (100, 24),
    ),
    "not-compared": Journey(
        [("mark another", lambda dash: setattr(dash.app, "marked_run", f"{CAMPAIGN}.1")), "C"],
        usual, run=f"{CAMPAIGN}.0",
    ),
    "watched": Journey(
        [has(live=(make_live(7, 20.0),)), heard(detailed()), "escape"],
        usual, run=RUNNING,
    ),
    "replayed": Journey([LOOK, "p", "escape"], passed, run=f"{CAMPAIGN}.0"),
    "no-judge": Journey([LOOK, ("it broke", broken)], judged, WIDE, RUNNING),
    "astray": Journey([astray(1e6), astray(1e15), astray(1e90)], running, WIDE, RUNNING),
    "decided": Journey([LOOK, "left", "n"], touching, (150, 40), RUNNING),
    "asked-for": Journey(
        [LOOK, opened("runs", CAMPAIGN), "j j j j j j j", opened("run", RUNNING), "escape"],
        running, (140, 40),
    ),
    "list": Journey(
        ["down", heard(time=61.0, contact=True), "enter", "tab", "tab", "tab"],
        judged, WIDE, RUNNING,
    ),
    "silent": Journey([has(now=lambda dash: dash.fake.now + 72.0)], running, WIDE, RUNNING),
    "never-said": Journey(
        [LOOK, has(live=(make_live(7, 60.0),),
             judged={RUNNING: replace(make_judgement(), verdicts=())}), "e"],
        lambda _: FakeDaemon(live=(make_live(7, waiting="waiting for [/map] of [amcl]"),)),
        (140, 40), RUNNING,
    ),
    "ends": Journey(
        [LOOK, "shift+tab", told("change", state=RunState.DONE, outcome=Outcome.FAIL)],
        ending, run=RUNNING,
    ),
    "goes-back": Journey(
        ["shift+left shift+left shift+left", heard(make_live(7, 62.0), time=62.0), "end",
         heard(make_live(7, 64.0), time=64.0), "space", heard(time=70.0), "space"],
        judged, WIDE, RUNNING,
    ),
    "failed": Journey([LOOK, "shift+tab"], usual, run=RUN),
    "running": Journey([LOOK, resized(120, 40)], running, run=RUNNING),
    "starting": Journey(
        [LOOK, opened("runs", CAMPAIGN), "j j j j j j j", "enter", resized(80, 24)], starting, WIDE
    ),
    "replay-keys": Journey(
        ["right", "left", "shift+right", "shift+left", "end", "home", "n", "n", "n", "N", "N"],
        replay(2.0),
    ),
    "replay-of-failures": Journey([LOOK], replay(None)),
    "replay-of-a-pass": Journey([LOOK], replay(None, judged=False)),
    "replay-in-time": Journey(
        ["space", passes(1.0), "space plus", passes(2.0), "minus minus", passes(62.0), "space"],
        replay(2.0),
    ),
    "replay-of-a-touch": Journey([("fast", fifty_times_as_fast), passes(0.1)], replay(2.0)),
    "replay-nearer": Journey(
        ["space", wheel(MouseScrollUp), wheel(MouseScrollUp), wheel(MouseScrollDown),
         wheel(MouseScrollDown), "z", "z", "Z"],
        replay(2.0),
    ),
    "replay-in-little-room": Journey([LOOK], replay(), (40, 10)),
    "replay-clicked": Journey(
        [LOOK, ("the middle of the signals is clicked on", middle_clicked),
         "right_parenthesis right_parenthesis", "left_parenthesis", "Z"],
        replay(2.0), (160, 40),
    ),
    "both": Journey([LOOK, "n", "t", "w end"], both, (140, 40)),
    "both-in-parts": Journey([LOOK, "n", "tab", "tab"], both),
    "both-in-no-room": Journey([LOOK, "tab", "tab", "tab", "z", "n", "t"], both, (20, 6)),
}  # fmt: skip


@pytest.mark.parametrize("name", JOURNEYS)
async def test_a_way_through_a_run_is_as_it_was(dashboard, golden, trace, monkeypatch, name):
    monkeypatch.chdir(trace.parent)  # so that paths are short
    way = JOURNEYS[name]
    dash = await dashboard(way.daemon(Path(trace.name)), way.size, run=way.run)
    golden(f"journeys/run-{name}.txt", await follow(dash, way.steps))
