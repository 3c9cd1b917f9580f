"""A daemon that answers from fixed data: the client's methods without a bus."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace

from daemon.batch.errors import Refused, Unreachable
from daemon.model.assessments import AssessmentRules, RepeatPolicy
from daemon.model.live_judgement import (
    DoorMotion,
    LiveJudgement,
    LiveSignal,
    LogLine,
    SignalLimit,
)
from daemon.model.messages import (
    Count,
    Empty,
    FilePart,
)
from daemon.model.run_state import RunState
from daemon.model.search_answer import SearchRow
from daemon.model.spec import (
    MapSettings,
    OracleText,
    RunResult,
    RunSpec,
    Snapshot,
    SutReference,
    Timing,
    TraceInfo,
)
from daemon.model.status import (
    CampaignRow,
    ChangeEvent,
    DaemonOverview,
    DeletedCampaign,
    DiskUsage,
    LiveSnapshot,
    Preparation,
    RunDetail,
    RunPage,
    RunRow,
    SubmissionReceipt,
    Trouble,
    TroubleCause,
    WorkerRow,
)
from daemon.model.submission import CampaignOrigin
from daemon.model.verbs import DaemonClient
from daemon.model.verdicts import Evidence, Outcome, Verdict
from grammars.model.behaviour import Hold
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot
from grammars.model.scene import Doorway, Joint, Link, Region, Scene, SceneObject, Solid
from grammars.text import codec

NOW = 1_800_000_000.0
CAMPAIGN = "first-ab12cd34"
WAITING = "starting my-nav2: 3 of 8 nodes active, waiting for planner_server"
OLD = "nightly-00ff00ff"


def box(x0, y0, x1, y1):
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def make_scene():
    """A corridor of 12 m x 4 m with a door leaf in its upper wall."""
    walls = (
        box(-0.2, -0.2, 12.2, 0.0),
        box(-0.2, 4.0, 5.0, 4.2),
        box(6.0, 4.0, 12.2, 4.2),
        box(-0.2, 0.0, 0.0, 4.0),
        box(12.0, 0.0, 12.2, 4.0),
    )
    solids = [Solid(f"hall-wall-{i}", "wall", w, 0.0, 2.5) for i, w in enumerate(walls)]
    solids.append(Solid("hall-wall-1", "wall", box(5.0, 4.0, 6.0, 4.2), 2.0, 2.5))
    leaf = Link("leaf", (box(0.0, -0.02, 0.95, 0.02),), 20.0, 0.0, 2.0)
    hinge = Joint("hinge", "revolute", "world", "leaf", (0.0, 0.0), (0.0, 0.0), -1.6, 1.6)
    door = SceneObject("door-1", "door", Pose2(5.0, 4.0, 0.0), (leaf,), (hinge,), (0.0,))
    doorway = Doorway("entry", Pose2(5.5, 4.1, 0.0), box(5.0, 4.0, 6.0, 4.2), 1.0, 0.0, 2.0)
    region = Region("hall", box(0.0, 0.0, 12.0, 4.0))
    return Scene("corridor", (region,), (doorway,), tuple(solids), (door,))


ROBOT = Robot(
    "robile",
    box(-0.35, -0.25, 0.35, 0.25),
    0.4,
    40.0,
    Drive("omnidirectional", 0.5, 0.5, 1.0, 1.0, 1.0, 2.0, 100.0, 40.0, 0.5),
    Laser(Mount(0.2), 0.3, -math.pi / 2, math.pi / 2, 181, 0.05, 10.0, 10.0, 0.01, 0.0),
    OdometryNoise(50.0, 0.01, 0.01, 0.01),
)
MISSION = Mission(
    "corridor",
    Pose2(1.0, 2.0, 0.0),
    (Waypoint("w1", 4.0, 2.0), Waypoint("w2", 8.0, 1.0), Waypoint("w3", 11.0, 3.0)),
)


def make_spec(row, scene):
    return RunSpec(
        campaign="first",
        scenario=row.scenario,
        sut=SutReference(row.sut, "pilot", {} if row.repeatable else {"repeatable": False}),
        repeat=row.repeat,
        scene=scene,
        robot=ROBOT,
        mission=MISSION,
        behaviours=(Hold("door-1.hinge", 0.4),),
        oracles=(
            OracleText("reached", "reach every waypoint within 20 min"),
            OracleText("no-contact", "robot never touches anything"),
        ),
        map=MapSettings(),
        seed=2024 + row.repeat,
        limit=row.limit,
    )


def make_row(index, **changes):
    row = RunRow(
        id=f"{CAMPAIGN}.{index}",
        campaign=CAMPAIGN,
        index=index,
        scenario="S1" if index < 5 else "S2",
        sut="pilot",
        repeat=index % 5,
        state=RunState.DONE,
        attempt=1,
        worker="bench-1",
        outcome=Outcome.PASS,
        oracle="no-contact",
        margin=0.2 + index / 100,
        unit="m",
        simulated=312.5,
        limit=1200.0,
        wall=8.25,
        trace=f"state/traces/{CAMPAIGN}/S1.pilot.{index}.mcap",
    )
    return replace(row, **changes)


NIGHTLY = tuple(make_row(i, id=f"{OLD}.{i}", campaign=OLD) for i in range(4))
"""The runs of a campaign in which all went well."""


def make_rows():
    fresh = {"outcome": None, "oracle": "", "margin": None, "unit": "", "simulated": 0.0,
             "wall": 0.0, "trace": ""}  # fmt: skip
    changes = {
        4: {"outcome": Outcome.INCONCLUSIVE, "oracle": "localised", "margin": None, "unit": "m"},
        5: {"outcome": Outcome.FAIL, "oracle": "no-contact", "margin": -0.0312},
        6: {"outcome": Outcome.FAIL, "oracle": "no-contact", "margin": -0.12},
        7: fresh | {"state": RunState.RUNNING},
        8: fresh | {"state": RunState.QUEUED, "worker": "", "attempt": 0},
        9: fresh | {"state": RunState.LOST, "reason": "worker bench-1 went away", "attempt": 3},
    }
    return tuple(make_row(i, **changes.get(i, {})) for i in range(10))


def make_result(row):
    if row.outcome is None:
        return None
    seen = Evidence(512.25, row.margin, 0.0, "door-1", "front left corner")
    decisive = Verdict(row.oracle, "robot never touches anything", row.outcome, row.margin,
                       row.margin, row.unit, seen)  # fmt: skip
    reached = Verdict(
        "reached", "reach every waypoint within 20 min", Outcome.PASS, 887.5, 887.5, "s",
        Evidence(312.5, 312.5, 1200.0),
    )  # fmt: skip
    travelled = Verdict("travelled", "path length", Outcome.MEASURE, None, None, "m",
                        Evidence(value=14.25))  # fmt: skip
    return RunResult(
        "0" * 64,
        row.outcome,
        (decisive, reached, travelled),
        "finished",
        TraceInfo("1" * 64, 1_234_567, 4321),
        Timing(row.wall, row.wall, row.simulated),
    )


def make_live(index=7, time=60.0, waiting=""):
    """A run on its way; at its start, with what it is ``waiting`` for, if there is anything."""
    pose = Pose2(1.0 + time / 20.0, 2.0, 0.1)
    snapshot = Snapshot(time, 1200.0, pose, Pose2(pose.x + 0.1, 2.1, 0.1), 1, 3, (-0.9,))
    if waiting:
        snapshot = Snapshot(0.0, 1200.0, Pose2(1.0, 2.0), None, 0, 3, (0.0,), waiting=waiting)
    return LiveSnapshot(f"{CAMPAIGN}.{index}", snapshot)


def make_judgement(index=7, time=60.0, *, contact=False):
    """What that run would be judged by now: near to a door once, a waypoint done, one ahead.

    With a ``contact`` it has failed for good.
    """
    parts = 60
    along = [time * part / parts for part in range(parts)]
    near = [0.11 + 0.9 * abs(math.sin((t - 27.0) / 15.0)) for t in along]
    nearest = min(27.0, time)
    error = [0.05 + 0.1 * abs(math.sin(t / 9.0)) for t in along]
    speed = [0.5 if t < 55.0 else 0.0 for t in along]
    signals = (
        _live_signal("loc.error", "m", time, error),
        _live_signal("clearance", "m", time, near, (SignalLimit(0.05, "below"),), ("clear",)),
        _live_signal("speed", "m/s", time, speed),
        _live_signal("elapsed", "s", time, along, (SignalLimit(1200.0),), ("reached",)),
    )
    clear = Verdict("clear", "always(clearance >= 0.05 m)", Outcome.PASS, 0.06, 0.06, "m",
                    Evidence(nearest, 0.11, 0.05, "door-1"))  # fmt: skip
    reached = Verdict("reached", "reach every waypoint within 20 min", Outcome.INCONCLUSIVE, -1.0,
                      None, "s", Evidence(note="1 of 3 waypoints reached"))  # fmt: skip
    touch = Verdict("no-contact", "robot never touches anything", Outcome.PASS, 1.0, 1.0, "")
    if contact:
        touch = replace(touch, outcome=Outcome.FAIL, lower=-1.0, upper=-1.0,
                        evidence=Evidence(nearest, object="door-1"))  # fmt: skip
    verdicts = (reached, touch, clear)
    log = [LogLine(t, "pilot", f"at {t:.0f} s") for t in along[::6]]
    if contact:
        log.append(LogLine(nearest, "contact", "robot touches door-1/leaf"))
    return LiveJudgement(
        f"{CAMPAIGN}.{index}", time, signals, verdicts,
        (DoorMotion(min(12.0, time), "door-1.hinge", opens=True),),
        (40.0,) if time > 40.0 else (), tuple(sorted(log, key=lambda line: line.time)), 3,
    )  # fmt: skip


def _live_signal(name, unit, end, values, limits=(), readers=()):
    return LiveSignal(name, unit, 0.0, end, tuple(values), tuple(values), limits, (), readers)


def campaign_row(name, id, rows, submitted_at):
    def states(state):
        return sum(row.state is state for row in rows)

    def outcomes(outcome):
        return sum(row.state is RunState.DONE and row.outcome is outcome for row in rows)

    open_runs = states(RunState.QUEUED) + states(RunState.RUNNING)
    return CampaignRow(
        *map(states, RunState), outcomes(Outcome.PASS), outcomes(Outcome.FAIL),
        outcomes(Outcome.INCONCLUSIVE), outcomes(Outcome.ERROR), id, name,
        "Corridor task with static and moving doors", submitted_at,
        None if open_runs else submitted_at + 120.0, len(rows),
    )  # fmt: skip


class FakeSubscription:
    def __init__(self, daemon):
        self._daemon = daemon

    def close(self):
        self._daemon.listeners.clear()


class FakeWatch:
    def __init__(self, daemon, run):
        self._daemon, self._run = daemon, run

    def close(self):
        del self._daemon.watchers[self._run]
        self._daemon.judges.pop(self._run, None)


@dataclass
class FakeDaemon(DaemonClient):
    """Holds runs and answers questions; ``reachable`` and ``before`` make it misbehave."""

    rows: tuple[RunRow, ...] = field(default_factory=make_rows)
    now: float = NOW
    reachable: bool = True
    calls: list[tuple[object, ...]] = field(default_factory=list)
    listeners: list[tuple[Callable[[ChangeEvent], None], Callable[[LiveSnapshot], None] | None]] = (
        field(default_factory=list)
    )
    watchers: dict[str, Callable[[LiveSnapshot], None]] = field(default_factory=dict)
    judges: dict[str, Callable[[LiveJudgement], None]] = field(default_factory=dict)
    live: tuple[LiveSnapshot, ...] = ()
    judged: dict[str, LiveJudgement] = field(default_factory=dict)
    before: Callable[[FakeDaemon], None] | None = None
    trouble: str = ""
    troubles: tuple[str, ...] = ()
    preparation: Preparation | None = None
    found: tuple[SearchRow, ...] = ()
    proposed: tuple[RunRow, ...] = ()
    empty: bool = False
    away: bool = False
    declares: AssessmentRules = field(
        default_factory=lambda: AssessmentRules(RepeatPolicy(5, "all", 1.0, False, 5))
    )

    @contextmanager
    def open(self):
        self._answer("open")
        yield self

    def _answer(self, *call):
        if self.before is not None:
            self.before(self)
        if not self.reachable:
            raise Unreachable("no daemon answers at tcp/127.0.0.1:7447: start one")
        self.calls.append(call)

    def ask(self, verb, request):
        """Answer with what ``_<verb>`` makes of the request; fails for a verb without one."""
        self._answer(verb.name, *(getattr(request, one.name) for one in fields(request)))
        return getattr(self, f"_{verb}")(request)

    def _overview(self, _):
        rows = self._campaign_rows()
        total = {
            name: sum(getattr(row, name) for row in rows)
            for name in ("queued", "running", "done", "lost", "cancelled", "passed", "failed",
                         "inconclusive", "errors")
        }  # fmt: skip
        left = 95.0 if total["queued"] + total["running"] else None
        return DaemonOverview(
            **total, version="0.1.0", state="state", started_at=NOW - 3600.0, now=self.now,
            campaigns=len(rows), workers=1, rate=12.5, seconds_left=left, halted=bool(self.trouble),
            troubles=tuple(
                Trouble(words, TroubleCause.OTHER)
                for words in (self.trouble, *self.troubles)
                if words
            ),
            preparation=self.preparation,
        )  # fmt: skip

    def _campaign_rows(self):
        if self.empty:
            return ()
        return (
            *(self._row_of(search) for search in self.found),
            campaign_row("first", CAMPAIGN, self.rows, NOW - 240.0),
            campaign_row("nightly", OLD, NIGHTLY, NOW - 90_000.0),
        )

    def _row_of(self, search):
        runs = tuple(row for row in self.rows if row.campaign == search.campaign)
        row = campaign_row(search.name, search.campaign, runs, search.submitted_at)
        return replace(row, search=search.state)

    def _campaigns(self, query):
        found = [
            row
            for row in self._campaign_rows()
            if query.id in ("", row.id)
            and query.name in ("", row.name)
            and row.id.startswith(query.beginning)
            and not (query.unfinished and row.finished)
        ]
        return tuple(found[query.offset : query.offset + query.limit])

    def _delete(self, request):
        return tuple(DeletedCampaign(name, 4, 3, 3 * 2**20) for name in request.campaigns)

    def _runs(self, query):
        if query.results and any(search.campaign == query.campaign for search in self.found):
            page = self.proposed[query.offset : query.offset + query.limit]
            return RunPage(page, len(self.proposed))
        rows = self.rows
        if query.results and not any(row.campaign == query.campaign for row in rows):
            rows = NIGHTLY
        found = [
            row
            for row in rows
            if query.campaign in ("", row.campaign)
            and query.scenario in ("", row.scenario)
            and query.sut in ("", row.sut)
            and query.state in ("", row.state)
            and query.outcome in ("", row.outcome)
            and query.text.lower() in f"{row.scenario}/{row.sut}/{row.repeat} {row.oracle}".lower()
        ]
        found.sort(key=lambda r: _sortable(getattr(r, query.sort)), reverse=query.descending)
        page = found[query.offset : query.offset + query.limit]
        if query.results:
            page = [self._with_result(row) for row in page]
        return RunPage(tuple(page), len(found))

    def _with_result(self, row):
        proposal = next((one.proposal for one in self.proposed if one.id == row.id), None)
        found = {"digest": f"{row.index:064d}", "seed": 2024 + row.repeat, "proposal": proposal}
        return replace(row, result=make_result(row), **found)

    def _run(self, request):
        for row in self.rows:
            if row.id == request.id:
                return RunDetail(self._with_result(row), make_spec(row, make_scene().digest))
        raise Refused(f"there is no run {request.id}")

    def _get(self, request):
        if request.run:
            raise Refused(f"{request.run}: its trace is gone")
        scene = codec.to_json(make_scene())
        return FilePart(len(scene), scene[request.offset :])

    def _declared(self, _):
        return self.declares

    def _origin(self, _):
        return CampaignOrigin()

    def _workers(self, _):
        return (
            WorkerRow(
                "bench-1",
                "bench",
                4711,
                "0.1.0",
                2,
                1,
                NOW - 3600.0,
                self.now - 2.0,
                cpu=0.45,
                memory=1_300_000_000,
                memory_total=16_000_000_000,
                runs=(f"{CAMPAIGN}.7",),
            ),
            WorkerRow(
                "shed-1", "shed", 812, "0.1.0", 4, 0, NOW - 600.0, self.now - 1.0, away=self.away
            ),
        )

    def _disk(self, _):
        return DiskUsage(10**12, 10**11, 2**20)

    def _cancel(self, _):
        return Count(2)

    _steer = _acknowledge = _cancel

    def _retry(self, _):
        return Count(1)

    def _searches(self, query):
        return tuple(
            row
            for row in self.found
            if query.campaign in ("", row.campaign) and not (query.unfinished and row.ended)
        )

    def _search_of(self, campaign):
        for row in self.found:
            if row.campaign == campaign:
                return row
        raise Refused(f"there is no search {campaign}")

    def _search(self, submission):
        return Empty()

    def _extend(self, request):
        self._search_of(request.runs.campaign)
        return Count(len(request.proposals))

    def _progress(self, progress):
        self._search_of(progress.campaign)
        return Empty()

    def _shutdown(self, _):
        return Empty()

    def submit(self, submission):
        self._answer("submit", submission.campaign)
        return SubmissionReceipt(submission.campaign, len(submission.runs), known=False)

    def events(self, on_event, on_live=None):
        self.listeners.append((on_event, on_live))
        if on_live is not None:
            for live in self.live:
                on_live(live)
        return FakeSubscription(self)

    def watch(self, run, on_live, on_judged=None):
        self.watchers[run] = on_live
        if on_judged is not None:
            self.judges[run] = on_judged
        return FakeWatch(self, run)


def _sortable(value):
    return (value is None, "" if value is None else value)
