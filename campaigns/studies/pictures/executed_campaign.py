"""A small executed campaign for pictures: the demo with a second, daring pilot.

Its runs are the same for everybody; only values that depend on the wall clock are made up.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from daemon.campaign import expand, load_campaign
from daemon.judging.live import judge_running, least_margin
from daemon.model.live_judgement import LiveJudgement
from daemon.model.spec import RunResult, RunSpec, Snapshot, Timing
from daemon.model.status import (
    LiveSnapshot,
    RunRow,
)
from daemon.model.submission import Submission
from daemon.model.sut import TICK_RATE
from daemon.model.verbs import OVERVIEW
from daemon.model.verdicts import RunState, deciding_verdict
from daemon.run import execute
from daemon.run_loop import RunLoop
from daemon.trace import TraceWriter
from tests.people.fake import NOW, Entered, FakeDaemon, store_scene

CAMPAIGN = "demo-5d0c1e7a"
NIGHTLY = "nightly-00ff00ff"
FAILED = "busy-house/daring/0"
"""A run that fails unexpectedly: a door swings into the robot."""
PASSED = "busy-house/pilot/0"
"""The same with the other pilot; in this campaign it is still running."""
REPEATS = 2
_CAMPAIGNS = Path(__file__).parents[2]
_DARING = """\
sut: daring
about: the pilot with hardly any distance to what is not on its map
like: pilot
parameters: {stop_distance: 0.0, blocked_distance: 0.1, safety_margin: 0.0}
"""
_UNDER_WAY = {PASSED: 61.0, "busy-house/pilot/1": 38.0}
"""Running runs, and their simulated time [s]."""


@dataclass(frozen=True)
class UnderWay:
    """A running run: its snapshots and its judgement so far."""

    snapshots: tuple[Snapshot, ...]
    judgement: LiveJudgement


@dataclass(frozen=True)
class ExecutedCampaign:
    """The runs of a campaign with their results; ``folder`` holds its traces."""

    folder: Path
    submission: Submission
    results: Mapping[str, RunResult]
    under_way: Mapping[str, UnderWay]


def name_of(spec):
    """Return the name of a run."""
    return f"{spec.scenario}/{spec.sut.name}/{spec.repeat}"


def trace_of(name):
    """Return the trace of a run, relative to the working directory of the daemon."""
    return f"state/traces/{CAMPAIGN}/{name.replace('/', '.')}.mcap"


def write_campaign(folder):
    """Write the demo with two pilots and ``REPEATS`` repeats below ``folder``; return its file."""
    for part in ("demo", "robots", "suts"):
        shutil.copytree(_CAMPAIGNS / part, folder / part)
    (folder / "suts" / "daring.yaml").write_text(_DARING)
    file = folder / "demo" / "campaign.yaml"
    text = re.sub(r"^repeats: \d+", f"repeats: {REPEATS}", file.read_text(), flags=re.M)
    # A search takes one system under test, so leave the searches out.
    text, _, _ = text.partition("\nsearch:")
    text = text.replace("{sut: [pilot]}", "{sut: [daring, pilot]}")
    # The most interesting scenario comes last, since the last runs are still running.
    head, busy, rude, expected = re.split(
        r"(?=^  busy-house:|^  rude-house:|^expect:)", text, flags=re.M
    )
    file.write_text(head + rude + busy + expected)
    return file


def execute_campaign(folder):
    """Execute all runs of the campaign below ``folder``, and two also up to a middle moment."""
    submission = expand(load_campaign(write_campaign(folder / "campaigns")))
    scenes = {scene.digest: scene for scene in submission.scenes}
    results, under_way = {}, {}
    for spec in submission.specs:
        name, scene = name_of(spec), scenes[spec.scene]
        if name in _UNDER_WAY:
            under_way[name] = _execute_until(spec, scene, _UNDER_WAY[name], folder / "under-way")
        path = folder / trace_of(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        result = execute(spec, scene, trace_path=path)
        simulated = result.timing.simulated
        timing = Timing(simulated / 300.0, simulated / 300.0, simulated, NOW - 60.0)
        results[name] = replace(result, timing=timing, machine="")
    return ExecutedCampaign(folder, submission, results, under_way)


def _execute_until(spec, scene, end, folder):
    """Execute a run up to a moment [s], and judge it there as its worker would."""
    folder.mkdir(exist_ok=True)
    snapshots = []
    with TraceWriter(folder / "run.mcap", spec, scene) as trace:
        loop = RunLoop(spec, scene, trace, snapshots.append, lambda: "everything")
        try:
            loop.begin()
            loop.advance(round(end * TICK_RATE))
            recorded = trace.so_far()
            judgement = judge_running(recorded)
            least = least_margin(judgement.verdicts)
        finally:
            loop.close()
    assert least is not None
    snapshots[-1] = replace(
        snapshots[-1], margin=least.margin, unit=least.unit, oracle=least.oracle
    )
    return UnderWay(tuple(snapshots), judgement)


@dataclass
class ExecutedDaemon(FakeDaemon):
    """Fake daemon with the executed campaign, two runs of which are still running.

    A nightly campaign executed the runs of the shipped pilot alone before.
    """

    executed: ExecutedCampaign | None = None
    specs: dict[str, RunSpec] = field(default_factory=dict)

    @classmethod
    def of(cls, executed):
        """Return a daemon with the runs of ``executed``."""
        specs = {f"{CAMPAIGN}.{i}": spec for i, spec in enumerate(executed.submission.specs)}
        running = [_row(i, run, spec) for i, (run, spec) in enumerate(specs.items())]
        rows = tuple(r if _name(r) in executed.under_way else _done(r, executed) for r in running)
        live, judged = [], {}
        for row in rows:
            under_way = executed.under_way.get(_name(row))
            if under_way is not None:
                live += [LiveSnapshot(row.id, snapshot) for snapshot in under_way.snapshots]
                judged[row.id] = replace(under_way.judgement, run=row.id)
        for index, spec in enumerate(s for s in executed.submission.specs if s.sut.name == "pilot"):
            run = f"{NIGHTLY}.{index}"
            specs[run] = spec
            rows += (_done(_row(index, run, spec), executed),)
        return cls(
            rows, live=tuple(live), judged=judged, declares=executed.submission.declared,
            executed=executed, specs=specs,
        )  # fmt: skip

    def result_of(self, row):
        """Return the result of a run, ``None`` for a running one."""
        assert self.executed is not None
        return self.executed.results[_name(row)] if row.state is RunState.DONE else None

    def ask(self, verb, request):
        """Answer like the daemon, with a speed independent of the machine."""
        answer = super().ask(verb, request)
        if verb is OVERVIEW:
            return replace(answer, rate=150.0, seconds_left=2.0)
        return answer

    def entered(self):
        """Return both campaigns."""
        for scene in self.executed.submission.scenes:
            store_scene(scene)
        about = self.executed.submission.about
        rows = [replace(row, result=self.result_of(row)) for row in self.rows]
        return tuple(
            Entered(id, name, tuple(row for row in rows if row.campaign == id), at, about)
            for id, name, at in (
                (NIGHTLY, "nightly", NOW - 40_000.0), (CAMPAIGN, "demo", NOW - 20.0)
            )
        )  # fmt: skip

    def spec_of(self, row):
        """Return the specification of a run."""
        return self.specs[row.id]


def _name(row):
    return f"{row.scenario}/{row.sut}/{row.repeat}"


def _row(index, run, spec):
    """Return the row of a running run."""
    return RunRow(
        run, run.rpartition(".")[0], index, spec.scenario, spec.sut.name, spec.repeat,
        RunState.RUNNING, 1, "bench-1", None, "", None, "", 0.0, spec.limit, 0.0, "",
    )  # fmt: skip


def _done(row, executed):
    """Return the row of a run with its result."""
    result = executed.results[_name(row)]
    verdict = deciding_verdict(result.verdicts)
    assert verdict is not None
    return replace(
        row, state=RunState.DONE, outcome=result.outcome, oracle=verdict.oracle,
        margin=verdict.margin, unit=verdict.unit, simulated=result.timing.simulated,
        wall=result.timing.wall, trace=trace_of(_name(row)),
    )  # fmt: skip
