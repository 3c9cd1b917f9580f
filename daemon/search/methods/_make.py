"""Methods by name, and why one cannot be used here."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from daemon.model.search import SPACE_FILLING, SearchParameter, SearchTask
from daemon.search.methods._boundary import MOST_PARAMETERS, BoundaryStage
from daemon.search.methods._cma import CmaStage
from daemon.search.methods._history import SearchHistory
from daemon.search.methods._stages import HaltonStage, RandomStage, SearchMethod, Stage
from daemon.search.methods._tpe import TpeStage
from daemon.search.space import SearchSpace
from grammars.text.diagnostics import InputError, Where, did_you_mean

METHODS: Final = ("auto", "halton", "random", "tpe", "cma", "boundary")
COVARIANCE_FROM: Final = 150
"""Proposals after which ``auto`` goes on with the method cma, where all parameters are ranges."""


@dataclass(frozen=True, slots=True)
class MethodProblem:
    """The reason why a method cannot be used, and in ``hint`` what can."""

    message: str
    hint: str

    def __str__(self) -> str:
        return f"{self.message}; {self.hint}"


def make_method(task: SearchTask, space: SearchSpace) -> SearchMethod:
    """Return the method of a search at its beginning.

    Raises :class:`InputError` where :func:`method_problem` has something to say.
    """
    problem = method_problem(task)
    if problem:
        raise InputError.at(Where(f'search "{task.name}"'), problem.message, problem.hint)
    return SearchMethod(SearchHistory(space, task.seed, task.window), _stages(task))


def method_problem(task: SearchTask) -> MethodProblem | None:
    """Return why the method of a search cannot be used, ``None`` when it can."""
    return method_misfit(task) or missing_library(task)


def method_misfit(task: SearchTask) -> MethodProblem | None:
    """Return why a method does not fit a search, on any machine, ``None`` when it does."""
    if task.method not in METHODS:
        hint = did_you_mean(task.method, METHODS)
        return MethodProblem(f'there is no method "{task.method}"', hint)
    lists = [parameter.name for parameter in task.parameters if parameter.choices]
    if task.method == "boundary":
        return _boundary_problem(task.parameters, lists)
    if task.method == "cma" and lists:
        message = f"the method cma takes ranges alone, {lists[0]} is a list"
        return MethodProblem(message, "write method: tpe")
    if task.method == "cma" and len(task.parameters) < 2:
        message = "the method cma takes two parameters or more"
        return MethodProblem(message, "write method: tpe")
    return None


def missing_library(task: SearchTask) -> MethodProblem | None:
    """Return which library the method of a search lacks here, ``None`` when it lacks none."""
    missing = [name for name in _libraries(task) if importlib.util.find_spec(name) is None]
    if not missing:
        return None
    install = 'install it with: pip install "scenario-tui[search]"'
    return MethodProblem(
        f"the method {task.method} takes the library {missing[0]}, which is not installed",
        f"{install}, or write method: halton, which works without",
    )


def _boundary_problem(
    parameters: Sequence[SearchParameter], lists: Sequence[str]
) -> MethodProblem | None:
    instead = "write method: auto, or vary less"
    if len(parameters) > MOST_PARAMETERS:
        message = f"the method boundary takes one or two parameters, not {len(parameters)}"
        return MethodProblem(message, instead)
    if lists:
        return MethodProblem(f"the method boundary takes ranges, {lists[0]} is a list", instead)
    return None


def _libraries(task: SearchTask) -> Sequence[str]:
    """Return the libraries that a search will import."""
    stages = _stages(task) if task.method in METHODS else []
    used = [stage for first, stage in stages if first < task.runs]
    of_tpe = ["optuna"] if any(isinstance(stage, TpeStage) for stage in used) else []
    return [*of_tpe, *(["cmaes"] if any(isinstance(stage, CmaStage) for stage in used) else [])]


def _stages(task: SearchTask) -> Sequence[tuple[int, Stage]]:
    """Return the stages of a method, each with the number of its first proposal."""
    match task.method:
        case "halton":
            return [(0, HaltonStage())]
        case "random":
            return [(0, RandomStage())]
        case "boundary":
            return [(0, BoundaryStage(task.runs, len(task.parameters)))]
        case "cma":
            return [(0, CmaStage())]
        case "tpe":
            return [(0, HaltonStage()), (SPACE_FILLING, TpeStage())]
        case _:
            ranges = all(not parameter.choices for parameter in task.parameters)
            adapts = ranges and len(task.parameters) > 1
            # What is proposed does not depend on the budget: more runs go on where fewer ended.
            later: list[tuple[int, Stage]] = [(COVARIANCE_FROM, CmaStage())] if adapts else []
            return [(0, HaltonStage()), (SPACE_FILLING, TpeStage()), *later]
