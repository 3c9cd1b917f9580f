"""Failures with known culprits: a campaign, and runs that are judged without being executed."""

from types import SimpleNamespace

from daemon.analysis.blame import (
    CandidateRunner,
    explain_failure,
    load_case,
    save_campaign,
)
from daemon.campaign import expand, load_campaign
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
HASTY = "sut: hasty\nlike: pilot\nparameters: {max_speed: 0.7, lookahead: 0.9}\n"


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
        return tuple(
            Verdict(o.name, o.text, outcome, None, None, "", Evidence())
            for o in candidate.spec.oracles
        )


def pretend(monkeypatch, rule):
    pretended = Pretended(rule)
    monkeypatch.setattr("daemon.analysis.blame._runner.execute_candidates", pretended)
    return pretended


def failing_if(condition):
    return lambda candidate: Outcome.FAIL if condition(candidate.spec) else Outcome.PASS


def write(folder, text=CAMPAIGN, **replacements):
    """Write the campaign, with words of it replaced: ``pilot="hasty"``, or pairs as a dict."""
    path = folder / "tiny.yaml"
    for old, new in replacements.items():
        text = text.replace(old, new)
    path.write_text(text)
    return path


def explain(path, sut="pilot", repeat=0, *, scenario="rude", budget=300, oracle=""):
    """Return the story of a failure."""
    case = load_case(path, scenario, sut, repeat)
    return explain_failure(case, CandidateRunner(budget), oracle).story


def explain_and_save(path, sut="pilot", repeat=0, *, scenario="rude"):
    """Return a failure's case, its story, its smallest run, and the campaign saved of it.

    The saved campaign stands in the folder ``saved`` beside the other; ``run`` is its last run.
    """
    case, runner = load_case(path, scenario, sut, repeat), CandidateRunner(300)
    found = explain_failure(case, runner)
    file = save_campaign(case, found, path.parent / "saved", runner)
    planned = expand(load_campaign(file))
    return SimpleNamespace(
        case=case, found=found, story=found.story, smallest=found.smallest.spec, runner=runner,
        file=file, runs=planned.specs, run=planned.specs[-1], scene=planned.scenes[0],
    )  # fmt: skip
