"""Searches at equal budget: random, space-filling and guided runs of the demonstration's doors.

The search ``doors-in-time`` is about all door times within 0.9 s of those written and both speeds,
twelve parameters. Runs are kept by digest: those that several methods ask for are executed once.
"""

from dataclasses import replace
from statistics import median

from daemon.search.points import changed_parameters
from daemon.search.program import run_search
from tests.analysis.search.searches import LocalRuns, load_search_case
from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, Reference, at_least, at_most
from tests.parts import ROOT

LONG = "900 runs"
CAMPAIGN = ROOT / "campaigns" / "demo" / "campaign.yaml"
EVEN, GUIDED = "halton", "auto"
METHODS = (EVEN, "random", GUIDED)
SEEDS, RUNS = 5, 60


def answer_of(method, seed, results):
    """Return the answer of a search; only the guided one brings its failure near the file."""
    progress.say(f"{method}, seed {seed}", seed)
    case = load_search_case(CAMPAIGN, "doors-in-time")
    how = {"seed": seed, "method": method, "runs": RUNS, "stop": "budget"}
    how |= {"then": ("nearest",), "confirm": 5} if method == GUIDED else {"then": (), "confirm": 0}
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
    failures, margins = {}, {}
    for method, searches in found.items():
        failures[method] = median(answer.failed for _, answer in searches)
        margins[method] = median(margin(answer) for _, answer in searches)
        goals = (at_least(1.5, of_ratio=True),) if method == GUIDED else ()
        name, even = f"{method}, {RUNS} runs", Reference(EVEN, failures[EVEN])
        yield Measurement(f"{name}: failures", failures[method], "runs", even, goals)
        even = Reference(EVEN, margins[EVEN])
        yield Measurement(f"{name}: smallest margin", margins[method], "m", even)
    guided = found[GUIDED]
    without = sum(answer.first is None for _, answer in guided)
    every, none = Reference("all", SEEDS), (at_most(0.0),)
    yield Measurement("guided searches without a failure", without, "seeds", every, none)
    changes = [
        len(changed_parameters(task, answer.nearest.result.point))
        for task, answer in guided
        if answer.nearest is not None
    ]
    name, goal = "parameters that a nearest failure changes, most", (at_most(3.0),)
    yield Measurement(name, max(changes, default=12), "parameters", Reference("all", 12), goal)
