"""Methods by name: those that ship, and those of others."""

from __future__ import annotations

from collections.abc import Sequence

from daemon.model.search import SPACE_FILLING, SearchTask
from daemon.search.methods._history import SearchHistory
from daemon.search.methods._protocol import SearchMethod
from daemon.search.methods._stages import HaltonStage, RandomStage, Stage, StagedMethod
from daemon.search.methods._tpe import TpeStage
from daemon.search.space import SearchSpace


def make_method(task: SearchTask, space: SearchSpace) -> SearchMethod:
    """Return the method of a search at its beginning."""
    return StagedMethod(SearchHistory(space, task.seed, task.window), _stages(task))


def _stages(task: SearchTask) -> Sequence[tuple[int, Stage]]:
    """Return the stages of a method, each with the number of its first proposal."""
    match task.method:
        case "halton":
            return [(0, HaltonStage())]
        case "random":
            return [(0, RandomStage())]
        case _:
            return [(0, HaltonStage()), (SPACE_FILLING, TpeStage())]
