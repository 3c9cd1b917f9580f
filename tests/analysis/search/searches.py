"""Searches whose runs are functions of their points, and their runs executed here."""

import json
import tempfile
import time
from functools import partial
from pathlib import Path

from daemon.analysis.blame import Candidate
from daemon.analysis.blame._runner import SLOTS
from daemon.analysis.child_runs import run_in_children
from daemon.campaign import load_campaign
from daemon.model.search import Proposal
from daemon.model.search_answer import SearchRow
from daemon.model.spec import LeadingMargin, RunResult, Timing, TraceInfo
from daemon.model.trials import ObjectiveValue, Trial
from daemon.model.verdicts import Evidence, Outcome, RunState, Verdict
from daemon.run import execute
from daemon.search.composition import search_case
from daemon.search.program import run_search
from grammars.text.diagnostics import InputError, Where
from tests.analysis.search.tasks import ORACLE, make_task
from tests.make import SCENE, make_spec, run_row


def load_search_case(file, name):
    """Load a campaign and one of its searches."""
    campaign = load_campaign(file)
    (task,) = (task for task in campaign.searches if task.name == name)
    return search_case(campaign, task)


def execute_with_leads(candidates):
    """Execute runs at the same time, each in a forked process, with leading margins."""
    runs = [(one.spec, one.scene) for one in candidates]
    with tempfile.TemporaryDirectory() as folder:
        ended = run_in_children(runs, Path(folder), execute_run=partial(execute, leads=True))
    return [one.result for one in ended]


class LocalRuns:
    """Executes runs in the order of their positions, ``slots`` at a time.

    The executor returns ``None`` for a run that left no result. ``results`` are kept by digest and
    may be shared with another search, which then reuses them.
    """

    def __init__(self, executor=execute_with_leads, slots=SLOTS, results=None, on_report=None):
        self.executor, self.slots, self._on_report = executor, slots, on_report
        self.results = {} if results is None else results
        self.proposals, self.digests = [], []
        self._started = time.monotonic()
        self._waiting, self._rows = [], {}

    def issue(self, proposal, candidate):
        """Take a run into the queue, or the result that is there."""
        assert proposal.position == len(self.proposals)
        digest = candidate.spec.digest
        self.proposals.append(proposal)
        self.digests.append(digest)
        if digest in self.results:
            self._settle(proposal.position, candidate, self.results[digest], "earlier")
        else:
            self._waiting.append((proposal.position, candidate))

    def issued(self, position):
        """Return nothing: there was no life before this one."""

    def result(self, position):
        """Execute what is before a run, and the run, and return it."""
        while position not in self._rows:
            batch, self._waiting = self._waiting[: self.slots], self._waiting[self.slots :]
            results = self.executor([candidate for _, candidate in batch])
            for (at, candidate), result in zip(batch, results, strict=True):
                if result is not None:
                    self.results[candidate.spec.digest] = result
                self._settle(at, candidate, result, "")
        return self._rows[position]

    def report(self, phase, note, answer):
        if self._on_report is not None:
            self._on_report(phase, note, answer)

    def elapsed(self):
        return time.monotonic() - self._started

    def _settle(self, position, candidate, result, cached):
        spec, proposal = candidate.spec, self.proposals[position]
        state = RunState.LOST if result is None else RunState.DONE
        self._rows[position] = run_row(
            f"{position:06d}", spec.scenario, spec.sut.name, spec.repeat, result, state=state,
            digest=spec.digest, cached=cached, proposal=proposal,
        )  # fmt: skip


def result_of(spec, margin, about="", margins=None):
    """The result of a run with a margin [m] for each oracle; without one it crashed."""
    common = (TraceInfo("0" * 64, 0, 0), Timing(0.01, 0.01, 5.0))
    if margin is None:
        return RunResult(spec.digest, Outcome.ERROR, (), "crashed", *common)
    verdicts = tuple(
        verdict_of(name, value, about) for name, value in (margins or {ORACLE: margin}).items()
    )
    outcome = Outcome.FAIL if margin < 0.0 else Outcome.PASS
    leads = tuple(LeadingMargin(v.oracle, v.lower, "m", about) for v in verdicts)
    return RunResult(spec.digest, outcome, verdicts, "finished", *common, leads=leads)


def verdict_of(oracle, margin, about="", unit="m"):
    outcome = Outcome.FAIL if margin < 0.0 else Outcome.PASS
    return Verdict(oracle, "always(...)", outcome, margin, margin, unit, Evidence(object=about))


class PretendedCase:
    """Composes runs that carry their point; their margin is a function of point and repeat.

    A margin of ``None`` is a run whose system crashes; ``refuses`` tells which points make no run.
    """

    def __init__(self, task, margin, refuses=lambda point: False):
        self.task, self._margin, self._refuses = task, margin, refuses
        self.executed = []

    def candidate(self, point, number, repeat=0):
        if self._refuses(point):
            raise InputError.at(Where("flat.fpm"), "a wall is in the way")
        scenario = self.task.scenario_of(number)
        return Candidate(make_spec(repeat, scenario=scenario, point=json.dumps(point)), SCENE)

    def found_text(self, result, *, comment, why=""):
        lines = "".join(f"# {line}\n" for line in comment.splitlines())
        name = self.task.scenario_of(result.number)
        return f"{lines}scenarios: {name} {list(result.point)}\n"

    def execute(self, candidates):
        return [self._result(candidate.spec) for candidate in candidates]

    def _result(self, spec):
        self.executed.append(spec.digest)
        point = tuple(json.loads(spec.sut.parameters["point"]))
        return result_of(spec, self._margin(point, spec.repeat), "door")

    def runs(self, slots=2, **more):
        return LocalRuns(self.execute, slots, **more)


def finished_search(*parameters, margin=lambda p, _: (7.0 - p[0]) / 10.0, **more):
    """A finished search with its runs; as a rule it fails above 7 of the first parameter."""
    task = make_task(*parameters, **({"confirm": 2} | more))
    case = PretendedCase(task, margin)
    runs = case.runs()
    answer = run_search(case, runs)
    rows = tuple(runs.result(position) for position in range(len(runs.proposals)))
    row = SearchRow("demo-s-1", "demo-s", 0.0, task, "finished", finished=len(rows), answer=answer)
    return row, rows


def made_trial(point, margin, number=0, near="door", method="halton", guided=False):
    """What a run of a point says; without a margin it is an error."""
    proposal = Proposal(number, number, 0, "explore", method, guided, point)
    if margin is None:
        return Trial(proposal, outcome=Outcome.ERROR)
    verdict = verdict_of(ORACLE, margin, near)
    value = ObjectiveValue(margin, margin, "m", ORACLE, near)
    run, label = f"{number}", f"s.{number}/pilot/0"
    return Trial(proposal, run, label, "d", verdict.outcome, value, verdict)
