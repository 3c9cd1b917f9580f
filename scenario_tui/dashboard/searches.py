"""The trials of the search in front."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from daemon.model.search import SearchTask
    from daemon.model.search_answer import SearchRow
    from daemon.model.trials import Trial
    from daemon.model.verbs import DaemonClient

_PAGE: Final = 500
"""Runs of a search per request."""


@dataclass(frozen=True, slots=True)
class SearchTrials:
    """A search and the trials of its runs in order, as far as fetched."""

    row: SearchRow
    trials: tuple[Trial, ...] = ()

    @property
    def explored(self) -> list[Trial]:
        """The trials that look for failures: no repeats, no later phases."""
        return [one for one in self.trials if one.explores]


@dataclass(frozen=True, slots=True)
class NotableTrial:
    """A trial to look at, the reason, and the ``count`` of failures like it.

    ``key`` identifies its place in the list, where another trial may stand later; ``about`` is the
    failing oracle and object.
    """

    key: str
    what: str
    trial: Trial
    about: str
    count: int = 0


class TrialReader:
    """Remembers the trials of a search, and fetches only new and unfinished ones."""

    def __init__(self) -> None:
        self._last: SearchTrials | None = None

    def read(self, daemon: DaemonClient, row: SearchRow) -> SearchTrials:
        """Return a search with its trials; they are replaced and never changed."""
        last = self._last
        if last is None:
            self._last = last = SearchTrials(row, self._ask(daemon, row, ()))
        elif _counts(row) != _counts(last.row):
            # Fetch all again at the end, and if finished runs are queued again.
            is_further = row.finished >= last.row.finished and row.state == last.row.state
            trials = last.trials if is_further else ()
            settled = itertools.takewhile(lambda one: one.outcome is not None, trials)
            self._last = last = SearchTrials(row, self._ask(daemon, row, settled))
        elif row != last.row:
            self._last = last = SearchTrials(row, last.trials)
        return last

    def _ask(
        self, daemon: DaemonClient, row: SearchRow, settled: Iterable[Trial]
    ) -> tuple[Trial, ...]:
        # Imported here, because the first screen does not need it.
        from daemon.model.trials import read_trial

        trials = list(settled)
        while len(trials) < row.proposed:
            page = daemon.runs(row.campaign, offset=len(trials), limit=_PAGE, results=True).rows
            if not page:
                break
            trials.extend(read_trial(row.task, one) for one in page)
        return tuple(trials)


def _counts(row: SearchRow) -> tuple[int, int, str]:
    return row.proposed, row.finished, row.state


def notable_trials(search: SearchTrials) -> Iterator[NotableTrial]:
    """Yield the trials to look at: best, first and nearest failure, findings, and as written.

    Those of the answer come with later phases; the best and the first failure come at once.
    """
    from daemon.model.trials import first_failure, smallest_margin

    task, answer, explored = search.row.task, search.row.answer, search.explored
    nearest = answer.nearest.result if answer is not None and answer.nearest else None
    best = "best" if search.row.ended else "best so far"
    named = {
        "best": (best, smallest_margin(explored)),
        "first": ("first failure", first_failure(explored)),
        "nearest": ("nearest failure", nearest),
    }
    for key, (what, trial) in named.items():
        if trial is not None:
            yield NotableTrial(key, what, trial, _about(task, trial))
    for index, finding in enumerate(answer.findings if answer is not None else ()):
        places = (finding.object, finding.waypoint)
        about = _joined(task, finding.oracle, *places)
        yield NotableTrial(f"finding-{index}", "finding", finding.example, about, finding.count)
    if explored and explored[0].is_written and explored[0].outcome is not None:
        yield NotableTrial("written", "as written", explored[0], _about(task, explored[0]))


def _about(task: SearchTask, trial: Trial) -> str:
    value = trial.value
    return "" if value is None else _joined(task, value.oracle, value.object)


def _joined(task: SearchTask, oracle: str, *places: str) -> str:
    # The only oracle of a search is in the headline.
    names = [*([oracle] if len(task.scales) > 1 else []), *places]
    return " › ".join(filter(None, names)) or oracle
