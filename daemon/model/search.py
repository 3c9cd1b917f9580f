"""A search for failures: its task, and its proposals.

A *search* varies parameters of the layers of one scenario and looks for the values with which an
oracle fails. A *point* has one value for each parameter, as a person would write it: a number in
the parameter's unit, rounded to its step, or one of its choices. A *proposal* is a point to run:
proposal ``n`` of search ``S`` is the scenario ``S.n``, so every run of a search is an ordinary run.
:mod:`daemon.model.trials` evaluates it; results are in :mod:`daemon.model.search_answer`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from daemon.model.ids import IdText, NonNegativeInt, ShortText
from daemon.model.submission import CampaignOrigin, Submission

ANY: Final = "any"
"""Takes the place of an oracle: the smallest of all margins, each divided by its scale."""
WINDOW: Final = 8
"""Pending proposals at a time; proposal n is made with the results of 0 to n - WINDOW."""
SPACE_FILLING: Final = 16
"""Runs of a scrambled Halton sequence, the written values first, before a search is guided."""
MOST_PROPOSALS: Final = 10_000
"""Most runs that a search may request."""
MOST_SEARCH_RUNS: Final = MOST_PROPOSALS + 2_000
"""Including the runs that repeat a failure, bring it nearer and shrink it."""
MOST_PARAMETERS: Final = 100
MOST_WINDOW: Final = 1_000
MOST_REPEATS: Final = 100
LONGEST_SEARCH: Final = 30 * 86_400.0
"""Longest wall clock time of a search [s]."""

SEARCH_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,39}$"
"""Pattern of a search's name: it is part of the names of runs, of its id and of files."""

PointValue: TypeAlias = float | str
Point: TypeAlias = tuple[PointValue, ...]
"""One value for each parameter of the search, in their order."""

ParameterSlot: TypeAlias = Literal[
    "floorplan", "vary", "objects", "behaviours", "mission", "robot", "sut"
]


@dataclass(frozen=True, slots=True)
class SearchParameter:
    """A varied parameter: a range of numbers, or a list of choices.

    ``name`` is as written (``doors_moving.swing``). Its value is an override in the scenario:
    ``{key: value}`` after the ``index``-th layer name of ``slot``. ``low``, ``high``, ``step`` and
    ``written`` are in ``unit``, as written in the range; it is empty for plain numbers.
    ``choices`` replace the range. ``written`` is the value in the scenario, which may lie outside
    of the range. Values of a ``whole`` parameter are whole numbers, those of a ``truth`` parameter
    ``"true"`` and ``"false"``. ``where`` is the file and line of the range.
    """

    name: str
    slot: ParameterSlot
    index: int
    key: str
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    step: float = 0.0
    log: bool = False
    choices: tuple[PointValue, ...] = ()
    written: PointValue | None = None
    where: str = ""
    whole: bool = False
    truth: bool = False

    def text(self, value: PointValue) -> str:
        """Return a value as in a file: ``52.5 deg/s``."""
        words = value if isinstance(value, str) else f"{value:.10g}"
        return f"{words} {self.unit}" if self.unit and not isinstance(value, str) else words

    def shown(self, value: PointValue) -> str:
        """Return a value for people: ``−0.12 m``, where files have ``-0.12 m``."""
        if isinstance(value, str):
            return value
        number, space, unit = self.text(value).partition(" ")
        return f"{number.replace('-', '−')}{space}{unit}"

    def override(self, value: PointValue) -> str | float | int | bool:
        """Return the parameter's value for a campaign file."""
        if self.truth:
            return value == "true"
        if isinstance(value, str) or self.unit:
            return self.text(value)
        return round(value) if self.whole else float(f"{value:.10g}")


@dataclass(frozen=True, slots=True)
class OracleScale:
    """Divisor [``unit``] of an oracle's margin when the smallest of all margins is minimised."""

    oracle: str
    scale: float
    unit: str


@dataclass(frozen=True, slots=True)
class SearchTask:
    """The complete, checked task of a search.

    ``minimise`` names an oracle, or is :data:`ANY`; ``scales`` has all oracles of the search, one
    or several. ``constraints`` are predicates over parameters as written. The search ends after
    ``runs`` proposals, after ``seconds`` of wall clock (0: never), or by its ``stop`` rule: after
    ``failures`` failures, or without further improvement (``settled``). Every reported failure is
    run ``confirm`` more times with other noise. With a system that is not ``repeatable`` the value
    of a point is the median of its repeats.
    """

    name: Annotated[str, Field(pattern=SEARCH_NAME)]
    scenario: ShortText
    sut: ShortText
    minimise: ShortText
    scales: tuple[OracleScale, ...]
    parameters: Annotated[
        tuple[SearchParameter, ...], Field(min_length=1, max_length=MOST_PARAMETERS)
    ]
    constraints: tuple[str, ...] = ()
    runs: Annotated[int, Field(ge=1, le=MOST_PROPOSALS)] = 60
    seconds: Annotated[float, Field(ge=0.0, le=LONGEST_SEARCH)] = 0.0
    stop: Literal["budget", "failures", "settled"] = "budget"
    failures: Annotated[int, Field(ge=1)] = 1
    method: ShortText = "auto"
    confirm: Annotated[int, Field(ge=0, le=MOST_REPEATS)] = 5
    then: tuple[Literal["nearest", "shrink"], ...] = ("nearest",)
    window: Annotated[int, Field(ge=1, le=MOST_WINDOW)] = WINDOW
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    repeatable: bool = True
    about: str = ""

    def short_name(self, name: str) -> str:
        """Return a parameter's name without its layer if that is unambiguous."""
        key = name.partition(".")[2]
        same = sum(
            other.name.partition(".")[2] == key or other.name == key for other in self.parameters
        )
        return key if key and same == 1 else name

    @property
    def drawn_word(self) -> str:
        """Word for runs that were chosen without looking at results."""
        return "random" if self.method == "random" else "space-filling"

    def scenario_of(self, number: int) -> str:
        """Return the name of the scenario of proposal ``number``."""
        return f"{self.name}.{number}"


@dataclass(frozen=True, slots=True)
class SearchSubmission:
    """A search that a client begins or resumes.

    ``campaign`` is its id in the ledger, derived from its content. ``source`` is the text of its
    campaign file, ``file`` the path of that file as typed. ``client`` names the process that makes
    the proposals, and is empty without one.
    """

    campaign: IdText
    name: str
    about: str
    source: str
    task: SearchTask
    file: ShortText = ""
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)
    fresh: bool = False
    client: ShortText = ""


Phase: TypeAlias = Literal["explore", "confirm", "nearest", "shrink"]
"""Purpose of a run: to find failures, to repeat one with other noise, to bring one nearer to the
scenario as written, to remove its unnecessary parts."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """Subject of a run of a search: a point and a purpose.

    ``number`` counts proposals, ``repeat`` the repeats of one; ``position`` counts runs. Proposals
    that are not ``guided`` were chosen without looking at results: only their runs show how
    frequent failures are. ``note`` describes an attempt that its point does not
    (``without bedroom_door``).
    """

    position: NonNegativeInt
    number: NonNegativeInt
    repeat: NonNegativeInt
    phase: Phase
    method: str
    guided: bool
    values: Point
    note: str = ""


@dataclass(frozen=True, slots=True)
class ExtendRequest:
    """More runs of a search, ``runs`` in the order of ``proposals``.

    Positions that have a run already keep it, so repeating the request is harmless.
    """

    client: ShortText
    proposals: Annotated[tuple[Proposal, ...], Field(min_length=1, max_length=1000)]
    runs: Submission
