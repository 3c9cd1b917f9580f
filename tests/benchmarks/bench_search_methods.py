"""Searches at equal budget: random, space-filling and guided runs of the demonstration's doors.

The search ``doors-in-time`` is about all door times within 0.9 s of those written and both speeds,
twelve parameters. Runs are kept by digest: those that several methods ask for are executed once.
"""

from dataclasses import replace
from statistics import median

from daemon.search.points import changed_parameters
from daemon.search.program import run_search
from tests.analysis.search.cases import load_search_case
from tests.analysis.search.local_runs import LocalRuns
from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, Reference, at_least, at_most
from tests.parts import ROOT

LONG = "900 runs"
CAMPAIGN = ROOT / "campaigns" / "demo" / "campaign.yaml"
METHODS = ("random", "halton", "auto")
SEEDS, RUNS = 5, 60
EVEN = "halton"


def answer_of(method, seed, results):
    """Return the answer of a search; only the guided one brings its failure near the file."""
    progress.say(f"{method}, seed {seed}", seed)
    case = load_search_case(CAMPAIGN, "doors-in-time")
    how = {"seed": seed, "method": method, "runs": RUNS, "stop": "budget"}
    how |= {"then": ("nearest",), "confirm": 5} if method == "auto" else {"then": (), "confirm": 0}
    task = replace(case.task, **how)
    return task, run_search(replace(case, task=task), LocalRuns(slots=2, results=results))


def margin(answer):
    best = answer.best
    return float("nan") if best is None or best.value is None else best.value.margin


def measure():
    """Yield medians over seeds, the space-filling search being the reference."""
    found = {method: [] for method in METHODS}
    for seed in range(SEEDS):
        results = {}
        for method in METHODS:
            found[method].append(answer_of(method, seed, results))
    even = {}
    for method in (EVEN, "random", "auto"):
        answers = [answer for _, answer in found[method]]
        values = {
            "failures": (
                median(one.failed for one in answers),
                "runs",
                at_least(1.5, of_ratio=True),
            ),
            "smallest margin": (median(map(margin, answers)), "m", None),
        }
        for what, (value, unit, goal) in values.items():
            beside = Reference(EVEN, even[what]) if even.get(what) else None
            goals = (goal,) if goal and method == "auto" else ()
            yield Measurement(f"{method}, {RUNS} runs: {what}", value, unit, beside, goals)
            if method == EVEN:
                even[what] = value
    guided = found["auto"]
    without = sum(answer.first is None for _, answer in guided)
    yield Measurement("guided searches without a failure", without, "seeds",
                      Reference("all", SEEDS), (at_most(0.0),))  # fmt: skip
    changes = [
        len(changed_parameters(task, answer.nearest.result.point))
        for task, answer in guided
        if answer.nearest is not None
    ]
    yield Measurement("parameters that a nearest failure changes, most", max(changes, default=12),
                      "parameters", Reference("all", 12), (at_most(3.0),))  # fmt: skip
