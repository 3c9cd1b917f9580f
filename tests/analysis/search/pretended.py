"""A search whose runs are a function of their points: composed and executed by nobody."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from daemon.analysis.blame import Candidate
from daemon.model.proposals import Proposal
from daemon.model.search import OracleScale, Point, SearchParameter, SearchTask
from daemon.model.spec import LeadingMargin, OracleText, RunResult, Timing, TraceInfo
from daemon.model.trials import ObjectiveValue, Trial
from daemon.model.verdicts import Evidence, Outcome, Verdict
from grammars.text.diagnostics import InputError, Where
from tests.analysis.search.local_runs import LocalRuns
from tests.make import SCENE, make_spec

ORACLE = "keeps-clear"
MarginFunction = Callable[[Point, int], float | None]
"""The margin [m] of a point in a repeat: ``None`` for a run whose system crashes."""


def seconds(name, written=5.0, low=0.0, high=10.0):
    key = name.partition(".")[2]
    return SearchParameter(name, "behaviours", 0, key, "s", low, high, 0.01, False, written=written)


def make_task(*parameters, **more):
    scales = (OracleScale(ORACLE, 1.0, "m"),)
    options = {"method": "halton", "runs": 20} | more
    return SearchTask("s", "busy", "pilot", ORACLE, scales, parameters, **options)


@dataclass
class PretendedCase:
    """Composes runs that carry their point; ``refuses`` says of which points there is none."""

    task: SearchTask
    margin: MarginFunction
    refuses: Callable[[Point], bool] = lambda _: False
    near: Callable[[Point], str] = lambda _: "door"
    executed: list[str] = field(default_factory=list)

    def candidate(self, point, number, repeat=0):
        if self.refuses(point):
            raise InputError.at(Where("flat.fpm"), "a wall is in the way")
        spec = make_spec(repeat, scenario=self.task.scenario_of(number), point=json.dumps(point))
        return Candidate(replace(spec, oracles=(OracleText(ORACLE, "always(...)"),)), SCENE)

    def run_case(self, point, number):
        raise NotImplementedError("a pretended run has no layers to take away")

    def found_text(self, result, *, comment, why=""):
        lines = "".join(f"# {line}\n" for line in comment.splitlines())
        name = self.task.scenario_of(result.number)
        return f"{lines}scenarios: {name} {list(result.point)}\n"

    def execute(self, candidates):
        return [self._result(candidate) for candidate in candidates]

    def _result(self, candidate):
        spec = candidate.spec
        self.executed.append(spec.digest)
        point = tuple(json.loads(spec.sut.parameters["point"]))
        margin = self.margin(point, spec.repeat)
        common = (TraceInfo("0" * 64, 0, 0), Timing(0.01, 0.01, 5.0))
        if margin is None:
            return RunResult(spec.digest, Outcome.ERROR, (), "crashed", *common)
        outcome = Outcome.FAIL if margin < 0.0 else Outcome.PASS
        about = self.near(point)
        verdict = Verdict(
            ORACLE, "always(...)", outcome, margin, margin, "m", Evidence(object=about)
        )
        lead = LeadingMargin(ORACLE, margin, "m", about)
        return RunResult(spec.digest, outcome, (verdict,), "finished", *common, leads=(lead,))

    def runs(self, slots=2, **more):
        return LocalRuns(slots=slots, executor=self.execute, **more)


def made_trial(point, margin, number=0, near="door", method="halton", guided=False):
    """What a run of a point says; without a margin it is an error."""
    proposal = Proposal(number, number, 0, "explore", method, guided, point)
    if margin is None:
        return Trial(proposal, outcome=Outcome.ERROR)
    outcome = Outcome.FAIL if margin < 0.0 else Outcome.PASS
    verdict = Verdict(ORACLE, "", outcome, margin, margin, "m", Evidence(object=near))
    value = ObjectiveValue(margin, margin, "m", ORACLE, near)
    return Trial(proposal, f"{number}", f"s.{number}/pilot/0", "d", outcome, value, verdict)
