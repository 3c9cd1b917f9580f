"""Searches without a scenario: parameters, and functions instead of runs."""

from daemon.model.search import ANY, SearchParameter, SearchTask
from daemon.search.methods import SearchMethod
from daemon.search.space import SearchSpace


def ranged(name="a", low=0.0, high=10.0, step=0.01, *, unit="s", log=False, written=5.0):
    return SearchParameter(name, "behaviours", 0, name, unit, low, high, step, log, written=written)


def chosen(name, *choices):
    return SearchParameter(name, "behaviours", 0, name, choices=choices, written=choices[0])


def search_task(*parameters, **more):
    return SearchTask("s", "scenario", "", ANY, (), parameters, **more)


def searched(task, worth, runs):
    """Search without a simulator; results are learnt as late as the window allows."""
    method = SearchMethod(task, SearchSpace(task))
    done = []
    for n in range(runs):
        ready = n - task.window
        if ready >= 0:
            method.learn(done[ready][1])
        proposal = method.propose()
        if proposal is None:
            break
        done.append((proposal, worth(proposal.values)))
    return done
