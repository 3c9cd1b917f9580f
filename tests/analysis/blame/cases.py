"""Campaigns with known culprits, and runs that are judged without being executed."""

from collections.abc import Callable

from daemon.analysis.blame import Candidate, CandidateResult
from daemon.model.verdicts import Evidence, Outcome, Verdict

CAMPAIGN = """\
campaign: tiny
seed: 3
repeats: 2
limit: 16 s
robot: courier
oracles: navigation
matrix: {sut: [pilot]}
scenarios:
  rude:
    floorplan: flat
    objects: [doors, people]
    behaviours:
      - doors_open
      - doors_in_your_face: {near: 1 m}
    mission: courier
    oracles: [reached, no-contact]
"""
Rule = Callable[[Candidate], Outcome]


class Pretended:
    """Stands in for the executor: verdicts by a rule about candidates, runs counted."""

    def __init__(self, rule):
        self._rule = rule
        self.specs = []
        self.interrupt_after = 10**9

    def __call__(self, candidates):
        return [self._endings(candidate) for candidate in candidates]

    def _endings(self, candidate):
        if len(self.specs) >= self.interrupt_after:
            raise KeyboardInterrupt
        self.specs.append(candidate.spec)
        outcome = self._rule(candidate)
        word = {Outcome.FAIL: "fail", Outcome.PASS: "pass"}.get(outcome, "unresolved")
        return tuple(
            CandidateResult(word, Verdict(o.name, o.text, outcome, None, None, "", Evidence()))
            for o in candidate.spec.oracles
        )


def pretend(monkeypatch, rule):
    pretended = Pretended(rule)
    monkeypatch.setattr("daemon.analysis.blame._runner.execute_candidates", pretended)
    return pretended


def failing_if(condition):
    return lambda candidate: Outcome.FAIL if condition(candidate.spec) else Outcome.PASS


def write(folder, text=CAMPAIGN):
    path = folder / "tiny.yaml"
    path.write_text(text)
    return path
