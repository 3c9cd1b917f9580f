"""Results of a search: failures, their certainty and nearness, and the state of the search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from daemon.model.ids import IdText, ShortText
from daemon.model.search import Phase, SearchTask
from daemon.model.trials import Trial

LONGEST_NOTE: Final = 2000
"""Longest note on a search [characters]."""
SearchState: TypeAlias = Literal["running", "waiting", "finished", "cancelled", "failed"]
"""State of a search; a ``waiting`` one goes on when a client runs it again."""


@dataclass(frozen=True, slots=True)
class Confirmation:
    """Failures among the repeats of a failing point with other noise.

    The failing run itself does not count: it was selected for its failure. ``low`` and ``high``
    bound the rate with 95 % certainty (Clopper and Pearson).
    """

    failed: int
    runs: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class NearestFailure:
    """The failure with the smallest change from the scenario as written; it fails with most noises.

    ``complete`` is false if the runs were used up before the last possible step. ``passes`` is the
    last passing point on the way to the written values.
    """

    result: Trial
    passes: Trial | None
    runs: int
    complete: bool
    confirmed: Confirmation | None = None


@dataclass(frozen=True, slots=True)
class DistinctFailure:
    """Failures of the same oracle with the same object, on the way to the same waypoint.

    ``example`` is the one with the smallest margin.
    """

    oracle: str
    object: str
    waypoint: str
    count: int
    example: Trial


@dataclass(frozen=True, slots=True)
class UnsoughtFailure:
    """An oracle outside of the search that fails in ``runs`` of its explored runs.

    If it fails ``as_written``, the findings may come from a run that had failed before.
    """

    oracle: str
    runs: int
    as_written: bool


@dataclass(frozen=True, slots=True)
class Influence:
    """Influence of a parameter: Spearman's rank correlation with the margin.

    Computed over the ``runs`` that were not guided; for choices the correlation ratio (0 to 1).
    """

    parameter: str
    correlation: float
    runs: int


@dataclass(frozen=True, slots=True)
class ShrunkScenario:
    """The smallest part of the nearest failure that still fails; ``left`` names it."""

    story: tuple[str, ...]
    minimal: bool
    runs: int
    left: str = ""


@dataclass(frozen=True, slots=True)
class SearchAnswer:
    """Results of a search, so far or in the end.

    ``ended`` is the reason of its end (``budget``, ``time``, ``failures``, ``settled``, ``errors``,
    ``exhausted``), empty while it may go on. ``refused`` of the ``explored`` proposals are points
    without a possible run. ``first`` is the failure of the lowest number, ``best`` the smallest
    margin. ``space_filling`` counts runs with a verdict whose points were drawn without looking at
    results (without the scenario as written); ``space_filling_failed`` of them fail. ``repeated``
    of the explored failures were also run with other noise; ``holding`` of these fail with most
    noises. ``unsought`` are failures of other oracles. ``sentences`` tell all of this, the rate of
    the failure first. ``found`` is the text of ``NAME.found.yaml``, empty without a failure.
    """

    ended: str
    explored: int
    executed: int
    reused: int
    failed: int
    errors: int
    inconclusive: int
    space_filling: int
    space_filling_failed: int
    first: Trial | None = None
    best: Trial | None = None
    confirmed: Confirmation | None = None
    nearest: NearestFailure | None = None
    shrunk: ShrunkScenario | None = None
    findings: tuple[DistinctFailure, ...] = ()
    influence: tuple[Influence, ...] = ()
    sentences: tuple[str, ...] = ()
    found: str = ""
    refused: int = 0
    repeated: int = 0
    holding: int = 0
    unsought: tuple[UnsoughtFailure, ...] = ()

    @property
    def reported_failure(self) -> Trial | None:
        """The reported failure: the nearest one, otherwise the first."""
        return self.first if self.nearest is None else self.nearest.result

    @property
    def reported_confirmation(self) -> Confirmation | None:
        """Confirmation of the reported failure; ``None`` if it was not repeated."""
        return self.confirmed if self.nearest is None else self.nearest.confirmed

    @property
    def shown(self) -> Trial | None:
        """The run to show: the reported failure, otherwise the best."""
        return self.reported_failure or self.best


@dataclass(frozen=True, slots=True)
class SearchRow:
    """A search and its state; ``note`` is the reason why it waits or failed.

    ``campaign`` is its id in the ledger, ``proposed`` and ``finished`` count runs. ``file`` is
    the path of its campaign file as typed, ``client`` the process that makes its proposals now.
    """

    campaign: str
    name: str
    submitted_at: float
    task: SearchTask
    state: SearchState
    phase: Phase = "explore"
    proposed: int = 0
    finished: int = 0
    note: str = ""
    answer: SearchAnswer | None = None
    file: str = ""
    client: str = ""

    @property
    def ended(self) -> bool:
        """True if the search has ended, for whatever reason."""
        return self.state not in ("running", "waiting")


@dataclass(frozen=True, slots=True)
class SearchQuery:
    """Query for all searches, for one, or for unfinished ones; the newest first."""

    campaign: IdText = ""
    unfinished: bool = False


@dataclass(frozen=True, slots=True)
class SearchProgress:
    """The state of a search as its client reports it: phase, note, the answer so far or at the end.

    A client that leaves a search reports it as ``waiting``.
    """

    campaign: IdText
    client: ShortText
    phase: Phase
    note: Annotated[str, Field(max_length=LONGEST_NOTE)] = ""
    state: SearchState = "running"
    answer: SearchAnswer | None = None
