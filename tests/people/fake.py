"""A daemon that answers from fixed data: the client's methods without a bus."""

import atexit
import functools
import itertools
import math
import operator
import shutil
import sqlite3
import tempfile
import threading
import weakref
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from daemon.batch.client import Client
from daemon.batch.errors import Unreachable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.ledger._connection import connect
from daemon.batch.ledger._entry import enter_runs
from daemon.batch.paths import StatePaths
from daemon.batch.server import _handlers, _workers
from daemon.batch.server._dispatcher import read_request
from daemon.batch.server._handlers import Handlers
from daemon.batch.server._housekeeping import Housekeeping
from daemon.batch.server._runtime import DaemonSettings, EventLog
from daemon.batch.stores import Marker
from daemon.model.assessments import AssessmentRules, RepeatPolicy
from daemon.model.live_judgement import DoorMotion, LiveJudgement, LiveSignal, LogLine, SignalLimit
from daemon.model.messages import RunProgress, WorkerInfo
from daemon.model.search import SearchSubmission
from daemon.model.search_answer import SearchProgress, SearchRow
from daemon.model.spec import (
    LeadingMargin,
    MapSettings,
    OracleText,
    RunResult,
    RunSpec,
    Snapshot,
    SutReference,
    Timing,
    TraceInfo,
)
from daemon.model.status import DiskUsage, LiveSnapshot, Preparation, RunRow, Trouble, TroubleCause
from daemon.model.submission import Submission
from daemon.model.verbs import OVERVIEW, SUBMIT, DaemonClient, ServerThread
from daemon.model.verdicts import UNFINISHED_STATES, Evidence, Outcome, RunState, Verdict
from grammars.model.behaviour import Hold
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot
from grammars.model.scene import Doorway, Joint, Link, Region, Scene, SceneObject, Solid
from grammars.text import codec
from tests.engine.judging.traces import box
from tests.make import FRESH

NOW = 1_800_000_000.0
CAMPAIGN = "first-ab12cd34"
WAITING = "starting my-nav2: 3 of 8 nodes active, waiting for planner_server"
OLD = "nightly-00ff00ff"


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
        repeat=index if index < 5 else index - 5,
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
    changes = {
        4: {"outcome": Outcome.INCONCLUSIVE, "oracle": "localised", "margin": None, "unit": "m"},
        5: {"outcome": Outcome.FAIL, "oracle": "no-contact", "margin": -0.0312},
        6: {"outcome": Outcome.FAIL, "oracle": "no-contact", "margin": -0.12},
        7: FRESH | {"state": RunState.RUNNING},
        8: FRESH | {"state": RunState.QUEUED, "worker": "", "attempt": 0},
        9: FRESH | {"state": RunState.LOST, "reason": "worker bench-1 went away", "attempt": 3},
    }
    return tuple(make_row(i, **changes.get(i, {})) for i in range(10))


def spread_rows(campaign, drop=0.0):
    """Five repeats whose margins spread, and are smaller by about ``drop`` [m]."""
    return tuple(
        make_row(
            i, campaign=campaign, id=f"{campaign}.{i}", margin=0.5 + i / 100 - drop * (1 + i / 9)
        )
        for i in range(5)
    )


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


@dataclass(frozen=True)
class Entered:
    """A campaign for the ledger with its runs; ``changes`` are those of its row there."""

    id: str
    name: str
    rows: tuple[RunRow, ...]
    submitted_at: float
    about: str = "Corridor task with static and moving doors"
    search: SearchRow | None = None
    changes: dict[str, object] = field(default_factory=dict)
    specs: list[RunSpec] | None = None
    declares: AssessmentRules | None = None


class _StatePaths(StatePaths):
    def disk(self):
        return DiskUsage(10**12, 10**11, 2**20)


@functools.cache
def state_paths():
    """Folders that the daemons of a test process share: scenes lie there by their digests."""
    # A TemporaryDirectory would go with the first forked child, which forgets what is registered.
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder)
    paths = _StatePaths(Path(folder))
    paths.make_folders()
    return paths


@functools.cache
def event_log():
    """The log that they write."""
    log = EventLog(state_paths().log)
    atexit.register(log.close)
    return log


@functools.cache
def store_scene(scene):
    """Keep a scene where the daemons find it."""
    state_paths().scene(scene.digest).write_bytes(codec.to_json(scene))
    return scene.digest


_TURNED = (_handlers, _workers)
_TURNING = threading.RLock()


@dataclass
class FakeDaemon(DaemonClient):
    """The daemon's own handlers on a ledger in memory, without a bus, at the time ``now``.

    What is set here is entered into the ledger anew before the next question: the ``rows`` of the
    campaign ``first``, searches that are ``found`` and their ``proposed`` runs, ``more`` campaigns.
    ``reachable`` and ``before`` make it misbehave; ``live`` and ``judged`` are published by tests.
    """

    rows: tuple[RunRow, ...] = field(default_factory=make_rows)
    now: float = NOW
    reachable: bool = True
    calls: list = field(default_factory=list)
    listeners: list = field(default_factory=list)
    watchers: dict = field(default_factory=dict)
    judges: dict = field(default_factory=dict)
    live: tuple[LiveSnapshot, ...] = ()
    judged: dict[str, LiveJudgement] = field(default_factory=dict)
    before: object = None
    trouble: str = ""
    troubles: tuple[str, ...] = ()
    preparation: Preparation | None = None
    found: tuple[SearchRow, ...] = ()
    proposed: tuple[RunRow, ...] = ()
    more: tuple[Entered, ...] = ()
    empty: bool = False
    away: bool = False
    state: str = "state"
    declares: AssessmentRules = field(
        default_factory=lambda: AssessmentRules(RepeatPolicy(5, "all", 1.0, False, 5))
    )
    _entered: tuple[object, ...] | None = None

    def __post_init__(self):
        paths, clock = state_paths(), _workers.LeaseClock(0.5)
        self._registry = _workers.WorkerRegistry(30.0, clock)
        log = event_log()
        self._handlers = Handlers(
            paths, DaemonSettings(), self._registry, log, _workers.LeaseDeadlines(30.0, clock),
            Housekeeping(paths, log, 0), version="0.1.0", stop=lambda: None,
            troubles=self._halting, marker=Marker("0" * 16, "1" * 16),
            starting=lambda: self.preparation,
        )  # fmt: skip

    def _halting(self):
        return (Trouble(self.trouble, TroubleCause.OTHER),) if self.trouble else ()

    @contextmanager
    def open(self):
        self._answer("open")
        yield self

    def at(self, actions):
        """Do something before it answers for the n-th time: ``{n: action}``."""
        times = itertools.count(1)
        self.before = lambda daemon: actions.get(next(times), lambda _: None)(daemon)

    def finish(self):
        """Have all runs be over; those that had no outcome pass."""
        self.rows = tuple(
            replace(row, state=RunState.DONE, outcome=row.outcome or Outcome.PASS)
            for row in self.rows
        )

    def told(self, verb):
        """What it was told to do by a verb."""
        return [call[1:] for call in self.calls if call[0] == verb]

    def _answer(self, *call):
        if self.before is not None:
            self.before(self)
        if not self.reachable:
            raise Unreachable("no daemon answers at tcp/127.0.0.1:7447: start one")
        self.calls.append(call)

    def ask(self, verb, request):
        """Answer as the daemon does, by way of the bytes that a bus would carry."""
        self._answer(verb.name, *(getattr(request, one.name) for one in fields(request)))
        return self._ask(verb, request)

    def _ask(self, verb, request):
        handler, payload = self._handlers.by_verb[verb], codec.to_json(request)
        with self._clock(self.now):
            self._enter()
            prepare = handler.prepare or partial(read_request, verb)
            asked = prepare(payload)
            if verb.thread is ServerThread.WRITER:
                self._db.row_factory = None
                with self._writer.transaction():
                    answer = handler.act(self._writer, asked)
            else:
                self._db.row_factory = sqlite3.Row
                self._handlers._estimate_again_at = -math.inf
                answer = handler.act(self._reader, asked)
        if verb is OVERVIEW:
            answer = replace(answer, state=self.state, started_at=NOW - 3600.0)
        return codec.from_json(verb.answer, codec.to_json(answer, verb.answer))

    @contextmanager
    def _clock(self, now):
        turned = SimpleNamespace(time=lambda: now, monotonic=lambda: now)
        with _TURNING, pytest.MonkeyPatch.context() as patch:
            for module in _TURNED:
                patch.setattr(module, "time", turned)
            yield

    def entered(self):
        """The campaigns as they are set, the oldest first, searches last."""
        if self.empty:
            return ()
        searches = []
        of = {id: tuple(r for r in self.rows if r.campaign == id) for id in (CAMPAIGN, OLD)}
        campaigns = {
            OLD: Entered(OLD, "nightly", of[OLD] or NIGHTLY, NOW - 90_000.0),
            CAMPAIGN: Entered(CAMPAIGN, "first", of[CAMPAIGN], NOW - 240.0),
            **{one.id: one for one in self.more},
        }
        for one in self.found:
            rows = tuple(row for row in self.proposed if row.campaign == one.campaign)
            found = Entered(one.campaign, one.name, rows, one.submitted_at, search=one)
            searches.append(found)
        return (*sorted(campaigns.values(), key=lambda one: one.submitted_at), *searches)

    def spec_of(self, row):
        """The specification of a run."""
        return make_spec(row, make_scene().digest)

    def _enter(self):
        self._greet_workers()
        inputs = (self.rows, self.found, self.proposed, self.more, self.empty, self.declares)
        if self._entered is not None and all(map(operator.is_, inputs, self._entered)):
            return
        store_scene(make_scene())
        self._db = connect(Path(":memory:"))
        weakref.finalize(self, self._db.close)
        self._writer = LedgerWriter(self._db, paths=state_paths())
        with self._writer.transaction():
            for campaign in self.entered():
                self._enter_campaign(campaign)
        self._reader = LedgerReader(self._db, state_paths())
        self._entered = inputs

    def _greet_workers(self):
        pace = RunProgress(f"{CAMPAIGN}.7", simulated=10.0 * 1200.0 / 105.0, elapsed=10.0)
        bench = WorkerInfo("bench-1", "bench", 4711, "0.1.0", 2, 1, cpu=0.45, memory=1_300_000_000,
                           memory_total=16_000_000_000, progress=(pace,))  # fmt: skip
        shed = WorkerInfo("shed-1", "shed", 812, "0.1.0", 4, 0)
        spares = [
            WorkerInfo(f"spare-{number}", "spare", 900 + number, "0.1.0", 1, 0, trouble=words)
            for number, words in enumerate(self.troubles, 1)
        ]
        first = not self._registry.rows()
        for info, came, silent in (
            (bench, 3600.0, 2.0),
            (shed, 600.0, 1.0),
            *((one, 600.0, 1.0) for one in spares),
        ):
            if first:
                with self._clock(NOW - came):
                    self._registry.record_contact(info)
            with self._clock(self.now - silent):
                self._registry.record_contact(info)
        if self.away:
            self._registry.disconnected("shed-1")

    def _enter_campaign(self, entered):
        rows = sorted(entered.rows, key=lambda row: row.index)
        specs = entered.specs or [self.spec_of(row) for row in rows]
        rules = entered.declares or self.declares
        runs = Submission.of(entered.id, specs, ())
        runs = replace(runs, name=entered.name, about=entered.about, declared=rules)
        search = entered.search
        if search is None:
            self._writer.submit(replace(runs, fresh=True), entered.submitted_at)
        else:
            self._enter_search(search, entered)
            enter_runs(self._db, runs)
        # The last first: rows that are left out make room for others.
        for position, row in reversed(list(enumerate(rows))):
            self._enter_row(f"{entered.id}.{position}", row)
        changes = dict(entered.changes)
        if not any(row.state in UNFINISHED_STATES for row in rows) and not (
            search is not None and not search.ended
        ):
            changes.setdefault("finished_at", entered.submitted_at + 120.0)
        if changes:
            values = ", ".join(f"{name} = ?" for name in changes)
            self._db.execute(
                f"UPDATE campaign SET {values} WHERE id = ?", (*changes.values(), entered.id)
            )

    def _enter_search(self, search, entered):
        submission = SearchSubmission(
            search.campaign, search.name, entered.about, "", search.task, search.file
        )
        self._writer.begin_search(submission, search.submitted_at)
        ledger_state = search.state if search.ended else "waiting"
        progress = SearchProgress(
            search.campaign, search.client, search.phase, search.note, search.state, search.answer
        )
        self._db.execute(
            "UPDATE search SET state = ?, progress = ? WHERE campaign = ?",
            (ledger_state, codec.to_json(progress), search.campaign),
        )
        if search.state == "running":
            self._handlers.clients.claim(search.campaign, search.client or "a client")
        else:
            self._handlers.clients.leave(search.campaign)

    def _enter_row(self, entered_id, row):
        result = None
        if row.state is RunState.DONE:
            result = row.result or make_result(row)
        lead = row.leads[0] if row.leads else LeadingMargin(row.oracle, row.margin, row.unit)
        values = {
            "id": row.id, "position": row.index, "state": str(row.state), "attempt": row.attempt,
            "worker": row.worker, "outcome": str(row.outcome or ""),
            "oracle": row.oracle or lead.oracle,
            "margin": lead.margin if row.margin is None else row.margin,
            "unit": row.unit or lead.unit, "simulated": row.simulated, "wall": row.wall,
            "reason": row.reason, "cached": row.cached, "repeatable": row.repeatable,
            "nondeterministic": row.nondeterministic, "trace_at": row.trace,
            "result": "" if result is None else result.digest,
        }  # fmt: skip
        if row.state is RunState.RUNNING:
            values |= {"token": 1 + row.index, "granted": 1 + row.index, "leased_at": NOW - 3.0}
        if row.state is RunState.DONE and row.campaign != OLD:
            values["finished_at"] = NOW - 28.8 + row.index
        names = ", ".join(f"{name} = ?" for name in values)
        self._db.execute(f"UPDATE run SET {names} WHERE id = ?", (*values.values(), entered_id))
        if result is not None:
            self._db.execute(
                "INSERT INTO result VALUES (?, ?, ?, ?, ?, ?)",
                (row.id, row.attempt, row.worker, result.digest, NOW, codec.to_json(result)),
            )
        if row.proposal is not None:
            self._db.execute(
                "INSERT INTO proposal VALUES (?, ?)", (row.id, codec.to_json(row.proposal))
            )

    def submit(self, submission):
        self._answer("submit", submission.campaign)
        Client.send_files(self, submission.cells)
        return self._ask(SUBMIT, submission)

    def events(self, on_event, on_live=None):
        self.listeners.append((on_event, on_live))
        if on_live is not None:
            for live in self.live:
                on_live(live)
        return SimpleNamespace(close=self.listeners.clear)

    def watch(self, run, on_live, on_judged=None):
        self.watchers[run] = on_live
        if on_judged is not None:
            self.judges[run] = on_judged

        def close():
            del self.watchers[run]
            self.judges.pop(run, None)

        return SimpleNamespace(close=close)
