"""What comes out of a search: failures, how sure they are, how near, and how the search stands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from daemon.model.proposals import Phase
from daemon.model.ranges import IdText, ShortText
from daemon.model.search import SearchTask
from daemon.model.trials import Trial

LONGEST_NOTE: Final = 2000
"""Characters of what is said of a search."""
SearchState: TypeAlias = Literal["running", "waiting", "finished", "cancelled", "failed"]
"""A search that is ``waiting`` goes on when a client runs it again."""


@dataclass(frozen=True, slots=True)
class Confirmation:
    """How many of the repeats of a point fail, with other noise than the run that was found.

    That run does not count: it was chosen for failing. ``low`` and ``high`` bound the rate with
    95 % certainty (Clopper and Pearson).
    """

    failed: int
    runs: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class NearestFailure:
    """The failure with the smallest change from the scenario as written; it fails with most noises.

    ``complete`` is false when runs were spent before nothing else could be taken back. ``passes``
    is the last point on the way to the written values that passes.
    """

    result: Trial
    passes: Trial | None
    runs: int
    complete: bool
    confirmed: Confirmation | None = None


@dataclass(frozen=True, slots=True)
class DistinctFailure:
    """Failures that are one: the same oracle, the same object, on the way to the same waypoint.

    ``example`` is the one with the smallest margin.
    """

    oracle: str
    object: str
    waypoint: str
    count: int
    example: Trial


@dataclass(frozen=True, slots=True)
class UnsoughtFailure:
    """An oracle that a search is not about and that fails in ``runs`` of its explored runs.

    Where it fails ``as_written``, what is found may be of a run that had gone wrong before.
    """

    oracle: str
    runs: int
    as_written: bool


@dataclass(frozen=True, slots=True)
class Influence:
    """How much a parameter decides: Spearman's rank correlation with the margin.

    It is of the ``runs`` that were not guided; for choices it is the correlation ratio (0 to 1).
    """

    parameter: str
    correlation: float
    runs: int


@dataclass(frozen=True, slots=True)
class ShrunkScenario:
    """The least of the nearest failure that still fails; ``left`` names what is left of it."""

    story: tuple[str, ...]
    minimal: bool
    runs: int
    left: str = ""


@dataclass(frozen=True, slots=True)
class SearchAnswer:
    """What a search has found, so far or in the end.

    ``ended`` says why it ended (``budget``, ``time``, ``failures``, ``settled``, ``errors``,
    ``exhausted``), empty while it may go on. Of the ``explored`` proposals ``refused``
    are points that no run can be made of. ``first`` is the failure of the lowest number, ``best``
    the smallest margin. Of the ``space_filling`` runs, those with a verdict that were drawn without
    looking at results (the scenario as written was not drawn), ``space_filling_failed`` fail. Of
    the failures that were explored, ``repeated`` were run with other noise as well, of which
    ``holding`` fail with most noises. ``unsought`` are failures of other oracles. ``sentences``
    tell all of it, how often the failure holds first. ``found`` is the text of ``NAME.found.yaml``,
    empty when nothing fails.
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
    def told_failure(self) -> Trial | None:
        """The failure that is handed on: the nearest one, otherwise the first."""
        return self.first if self.nearest is None else self.nearest.result

    @property
    def told_confirmation(self) -> Confirmation | None:
        """How often the failure that is handed on holds; ``None`` where it was not repeated."""
        return self.confirmed if self.nearest is None else self.nearest.confirmed

    @property
    def shown(self) -> Trial | None:
        """The run to look at closely: the failure that is handed on, else the best."""
        return self.told_failure or self.best


@dataclass(frozen=True, slots=True)
class SearchRow:
    """A search and how it stands; ``note`` says what keeps it or why it failed.

    ``campaign`` is its id in the ledger, ``proposed`` and ``finished`` count runs. ``file`` is
    the path of its campaign file as it was typed, ``client`` the process that makes its proposals
    just now.
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
        """Whether the search has come to its end, for whatever reason."""
        return self.state not in ("running", "waiting")


@dataclass(frozen=True, slots=True)
class SearchQuery:
    """Searches, the newest first; all of them, or one, or those that have not ended."""

    campaign: IdText = ""
    unfinished: bool = False


@dataclass(frozen=True, slots=True)
class SearchProgress:
    """The state of a search as its client reports it: phase, note, the answer so far or at the end.

    A client that leaves a search says that it is ``waiting``.
    """

    campaign: IdText
    client: ShortText
    phase: Phase
    note: Annotated[str, Field(max_length=LONGEST_NOTE)] = ""
    state: SearchState = "running"
    answer: SearchAnswer | None = None
