"""Tasks of searches, and methods that search functions; it loads little."""

import math

from daemon.model.search import OracleScale, SearchParameter, SearchTask
from daemon.search.methods import SearchMethod
from daemon.search.space import SearchSpace

ORACLE = "keeps-clear"


def ranged(name="a", low=0.0, high=10.0, step=0.01, *, unit="s", log=False, written=5.0):
    """A parameter that is a range."""
    key = name.rpartition(".")[2]
    return SearchParameter(name, "behaviours", 0, key, unit, low, high, step, log, written=written)


def chosen(name, *choices):
    """A parameter that is a list of choices, the first one as written."""
    key = name.rpartition(".")[2]
    return SearchParameter(name, "behaviours", 0, key, choices=choices, written=choices[0])


def make_task(*parameters, **changes):
    """A search for failures of one oracle over these parameters."""
    scales = (OracleScale(ORACLE, 1.0, "m"),)
    options = {"method": "halton", "runs": 20} | changes
    return SearchTask("s", "busy", "pilot", ORACLE, scales, parameters, **options)


def searched(task, worth, runs):
    """Search without runs: pairs of proposal and value, learnt as late as the window allows."""
    method, pairs = SearchMethod(task, SearchSpace(task)), []
    for n in range(runs):
        if n >= task.window:
            method.learn(pairs[n - task.window][1])
        proposal = method.propose()
        if proposal is None:
            break
        pairs.append((proposal, worth(proposal.values)))
    return pairs


def mixed_task():
    """A search over a logarithm, whole numbers and words."""
    parameters = ranged("a", 0.01, 10.0, 0.001, log=True), ranged("c", 1, 9, 1)
    return make_task(*parameters, chosen("b", "left", "middle", "right"), method="auto", runs=60)


def mixed(point):
    """Values that are least near the third word."""
    a, c, b = point
    return abs(math.log10(a) - 0.5) + (b != "right") + 0.1 * abs(c - 2.0)
