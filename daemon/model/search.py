"""A search for failures: what is asked for.

A *search* varies parameters of the layers of one scenario and looks for the values with which an
oracle fails. A *point* has one value for each parameter, as a person would write it: a number in
the parameter's unit, rounded to its step, or one of its choices. What is run for it is told in
:mod:`daemon.model.proposals`, what comes out of it in :mod:`daemon.model.search_answer`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from daemon.model.ranges import IdText, ShortText
from daemon.model.submission import CampaignOrigin

ANY: Final = "any"
"""Instead of an oracle: the smallest of all margins, each divided by its scale."""
WINDOW: Final = 8
"""Proposals that may be out at a time; proposal n is made knowing the results 0 to n - WINDOW."""
SPACE_FILLING: Final = 16
"""Runs of a scrambled Halton sequence, the written values first, before a search is guided."""
MOST_PROPOSALS: Final = 10_000
"""Runs a search may be asked for."""
MOST_SEARCH_RUNS: Final = MOST_PROPOSALS + 2_000
"""With those that repeat a failure, bring it near and shrink it."""
MOST_PARAMETERS: Final = 100
MOST_WINDOW: Final = 1_000
MOST_REPEATS: Final = 100
LONGEST_SEARCH: Final = 30 * 86_400.0
"""Seconds of wall clock a search may be asked for."""

SEARCH_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,39}$"
"""Of a search: part of the names of its runs, of its id and of files."""

PointValue: TypeAlias = float | str
Point: TypeAlias = tuple[PointValue, ...]
"""One value for each parameter of the search, in their order."""

ParameterSlot: TypeAlias = Literal[
    "floorplan", "vary", "objects", "behaviours", "mission", "robot", "sut"
]


@dataclass(frozen=True, slots=True)
class SearchParameter:
    """Something that is varied: a range of numbers, or a list of choices.

    ``name`` is as written (``doors_moving.swing``); ``slot``, ``index`` and ``key`` say beside
    which of the scenario's layer names its value is written as an override: ``{key: value}``
    beside the ``index``-th name of that slot. ``low``, ``high``, ``step`` and ``written`` are in
    ``unit``, as written in the range; it is empty for plain numbers. With ``choices`` there is no
    range. ``written`` is the value that the scenario has, which may lie outside of the range.
    Values of a ``whole`` parameter are whole numbers, those of a ``truth`` parameter ``"true"``
    and ``"false"``. ``where`` is the place of the range: file and line.
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
        """Return a value as it is written in a file: ``52.5 deg/s``."""
        words = value if isinstance(value, str) else f"{value:.10g}"
        return f"{words} {self.unit}" if self.unit and not isinstance(value, str) else words

    def shown(self, value: PointValue) -> str:
        """Return a value for people: ``−0.12 m``, where files have ``-0.12 m``."""
        if isinstance(value, str):
            return value
        number, space, unit = self.text(value).partition(" ")
        return f"{number.replace('-', '−')}{space}{unit}"

    def override(self, value: PointValue) -> str | float | int | bool:
        """Return what stands in a campaign file as the parameter's value."""
        if self.truth:
            return value == "true"
        if isinstance(value, str) or self.unit:
            return self.text(value)
        return round(value) if self.whole else float(f"{value:.10g}")


@dataclass(frozen=True, slots=True)
class OracleScale:
    """By what [in ``unit``] an oracle's margin is divided where the smallest of all counts."""

    oracle: str
    scale: float
    unit: str


@dataclass(frozen=True, slots=True)
class SearchTask:
    """A search as it is asked for, checked and complete.

    ``minimise`` names an oracle, or is :data:`ANY`; ``scales`` has all oracles it is about, one or
    several. ``constraints`` are predicates over parameters as written. The search ends when
    ``runs`` proposals are made, when ``seconds`` of wall clock are over (0: never), or as ``stop``
    says: after so many ``failures``, or when nothing got better for a while (``settled``).
    Every failure that is told is run ``confirm`` times more with other noise. With a system that
    is not ``repeatable`` the value of a point is the median of its repeats.
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
        """Return a parameter's name without its layer, where no other one is called so."""
        key = name.partition(".")[2]
        same = sum(
            other.name.partition(".")[2] == key or other.name == key for other in self.parameters
        )
        return key if key and same == 1 else name

    @property
    def drawn_word(self) -> str:
        """What runs are called that were chosen without looking at results."""
        return "random" if self.method == "random" else "space-filling"

    def scenario_of(self, number: int) -> str:
        """Return the name of the scenario that proposal ``number`` is."""
        return f"{self.name}.{number}"


@dataclass(frozen=True, slots=True)
class SearchSubmission:
    """A search that a client begins, or goes on with.

    ``campaign`` is its id in the ledger, made of its content. ``source`` is the text of its
    campaign file, ``file`` the path of that file as it was typed. ``client`` names the process
    that makes the proposals, and is empty while none does.
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
