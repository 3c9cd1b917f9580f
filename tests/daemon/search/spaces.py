"""Searches without a scenario: parameters, and functions instead of runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from daemon.model.search import ANY, Point, PointValue, SearchParameter, SearchTask
from daemon.search.methods import MethodProposal, SearchMethod, make_method
from daemon.search.space import SearchSpace


def ranged(
    name: str = "a",
    low: float = 0.0,
    high: float = 10.0,
    step: float = 0.01,
    *,
    unit: str = "s",
    log: bool = False,
    written: PointValue | None = 5.0,
) -> SearchParameter:
    return SearchParameter(name, "behaviours", 0, name, unit, low, high, step, log, written=written)


def chosen(name: str, *choices: PointValue) -> SearchParameter:
    return SearchParameter(name, "behaviours", 0, name, choices=choices, written=choices[0])


def search_task(*parameters: SearchParameter, **more: Any) -> SearchTask:
    return SearchTask("s", "scenario", "", ANY, (), parameters, **more)


def searched(
    task: SearchTask,
    worth: Callable[[Point], float | None],
    runs: int,
    method: SearchMethod | None = None,
) -> list[tuple[MethodProposal, float | None]]:
    """Search without a simulator; results are learnt as late as the window allows."""
    method = method or make_method(task, SearchSpace(task))
    done: list[tuple[MethodProposal, float | None]] = []
    for n in range(runs):
        ready = n - task.window
        if ready >= 0:
            method.learn(ready, done[ready][0].values, done[ready][1])
        proposal = method.propose(n)
        if proposal is None:
            break
        done.append((proposal, worth(proposal.values)))
    return done
