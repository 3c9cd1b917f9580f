"""A search for failures: what is asked, what is proposed, what came out of it.

A *search* varies parameters of the layers of one scenario and looks for the values with which an
oracle fails. A *point* has one value for each parameter, as a person would write it: a number in
the parameter's unit, rounded to its step, or one of its choices. A *proposal* is a point that is
to be run; proposal ``n`` of search ``S`` is the scenario ``S.n``, so that every run of a search is
an ordinary run. What is learnt of a run is its *leading margin*: a signed margin that goes down
towards a failure also where the verdict's own margin is flat.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from daemon.model.messages import IdText, NonNegativeInt, ShortText
from daemon.model.packed_submission import PackedSubmission
from daemon.model.spec import LeadingMargin
from daemon.model.status import RunState
from daemon.model.verdicts import Evidence, Outcome, Verdict

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
LARGEST_BUNDLE: Final = 32 * 2**20
"""Bytes of all files of a search together."""

SEARCH_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,39}$"
"""Of a search: part of the names of its runs, of its id and of files."""

PointValue: TypeAlias = float | str
Point: TypeAlias = tuple[PointValue, ...]
"""One value for each parameter of the search, in their order."""

ParameterSlot: TypeAlias = Literal[
    "floorplan", "vary", "objects", "behaviours", "mission", "robot", "sut"
]
Phase: TypeAlias = Literal["explore", "confirm", "nearest", "shrink"]
"""What a run is for: to find failures, to repeat one with other noise, to bring one nearer to the
scenario as written, to take away from it what it does not need."""
SearchState: TypeAlias = Literal["running", "finished", "cancelled", "failed"]


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
    several. ``constraints`` are inequalities between parameters as written. The search ends when
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
class BundledFile:
    """A file that a campaign is made of; ``path`` is relative and leads nowhere else."""

    path: Annotated[str, Field(max_length=1000)]
    data: str
    """Its bytes in base64."""


@dataclass(frozen=True, slots=True)
class SearchSubmission:
    """A search on its way to the daemon, with the files its proposals are composed of.

    ``campaign`` is its id in the ledger, made of its content; ``file`` is the path of the campaign
    file among ``files``. ``source`` is that file's text.
    """

    campaign: IdText
    name: str
    about: str
    source: str
    task: SearchTask
    file: str
    files: tuple[BundledFile, ...]
    fresh: bool = False


@dataclass(frozen=True, slots=True)
class Proposal:
    """What a run of a search is about: a point and a purpose.

    ``number`` counts proposals, ``repeat`` the repeats of one; ``position`` counts runs. What is
    not ``guided`` was chosen without looking at results: only such runs tell how frequent failures
    are. ``note`` says in a few words what was tried (``without bedroom_door``), where a point does
    not.
    """

    position: int
    number: int
    repeat: int
    phase: Phase
    method: str
    guided: bool
    values: Point
    note: str = ""


@dataclass(frozen=True, slots=True)
class ExtendRequest:
    """More runs of a search, ``runs`` in the order of ``proposals``.

    What is there already at its position is left as it is, so that asking twice is harmless.
    """

    campaign: IdText
    proposals: Annotated[tuple[Proposal, ...], Field(min_length=1, max_length=1000)]
    runs: PackedSubmission


@dataclass(frozen=True, slots=True)
class ProposalQuery:
    """A page of the runs of a search, in order; ``finished`` ones alone, if asked."""

    campaign: IdText
    offset: NonNegativeInt = 0
    limit: Annotated[int, Field(ge=0, le=1000)] = 500


@dataclass(frozen=True, slots=True)
class ProposalRow:
    """A run of a search as the ledger has it; without a result it has no ``outcome``.

    ``run`` is its id, ``label`` its name for people, ``cached`` whether the result was there
    before; ``ended`` is as in :class:`daemon.model.spec.RunResult`.
    """

    proposal: Proposal
    run: str
    label: str
    digest: str
    state: RunState
    outcome: Outcome | None = None
    verdicts: tuple[Verdict, ...] = ()
    leads: tuple[LeadingMargin, ...] = ()
    ended: str = ""
    note: str = ""
    cached: bool = False
    simulated: float = 0.0
    wall: float = 0.0
    cpu: float = 0.0
    trace: str = ""

    @property
    def settled(self) -> bool:
        """Whether nothing more comes of it: it has a result, or none ever will."""
        return self.state in (RunState.DONE, RunState.LOST, RunState.CANCELLED)


@dataclass(frozen=True, slots=True)
class ObjectiveValue:
    """What a run is worth to a search: ``value`` is compared, ``margin`` in ``unit`` is told.

    Both are the same where one oracle is minimised. ``oracle`` is the one that is nearest to
    failing, ``object`` what it is about, ``waypoint`` the one that the robot was on its way to.
    """

    value: float
    margin: float
    unit: str
    oracle: str
    object: str = ""
    waypoint: str = ""


def objective(task: SearchTask, leads: Sequence[LeadingMargin]) -> ObjectiveValue | None:
    """Return what a run with these leading margins is worth; ``None`` when it has no value."""
    best: ObjectiveValue | None = None
    for lead in leads:
        scale = next((s for s in task.scales if s.oracle == lead.oracle), None)
        if scale is None or lead.margin is None:
            continue
        value = lead.margin if len(task.scales) == 1 else lead.margin / scale.scale
        if best is None or value < best.value:
            best = ObjectiveValue(
                value, lead.margin, lead.unit, lead.oracle, lead.object, lead.waypoint
            )
    return best


@dataclass(frozen=True, slots=True)
class PointResult:
    """A proposal with what it gave: its verdict, its margin, and the run to look at.

    ``outcome`` is that of the oracle in question; an error where the run cannot be trusted.
    ``unsought`` are the oracles that fail in the run and that the search is not about.
    """

    number: int
    position: int
    values: Point
    outcome: Outcome | None
    value: ObjectiveValue | None
    verdict: Verdict | None
    run: str
    label: str
    digest: str
    unsought: tuple[str, ...] = ()

    @property
    def fails(self) -> bool:
        """Whether the oracle in question fails."""
        return self.verdict is not None and self.verdict.outcome is Outcome.FAIL

    @property
    def about(self) -> str:
        """What it is about: the object of the margin that is told, else that of the verdict.

        They may differ: a mission fails at the waypoint that was never near, its margin is the way
        that was missing from the first one that was not reached.
        """
        value, verdict = self.value, self.verdict
        if value is not None and value.object and (not verdict or value.oracle == verdict.oracle):
            return value.object
        return verdict.evidence.object if verdict is not None else ""


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
class ParameterChange:
    """A parameter that is not as written; ``passing`` is the nearest value that still passes."""

    parameter: str
    unit: str
    written: PointValue | None
    value: PointValue
    passing: PointValue | None = None


@dataclass(frozen=True, slots=True)
class NearestFailure:
    """The failure with the smallest change from the scenario as written.

    ``complete`` is false when runs were spent before nothing else could be taken back. ``passes``
    is the last point on the way to the written values that passes. ``sentence`` tells it all:
    "kitchen_opens 0.54 s later (8.54 s instead of 8 s) and keeps-clear fails by 0.018 m".
    ``unconfirmed`` is a smaller change that fails too, but not with most of other noise. Where it
    ``holds`` it fails with most noises; else no failure that was tried does, and one noise decided.
    """

    result: PointResult
    changes: tuple[ParameterChange, ...]
    passes: PointResult | None
    runs: int
    complete: bool
    sentence: str
    confirmed: Confirmation | None = None
    unconfirmed: PointResult | None = None
    holds: bool = True


@dataclass(frozen=True, slots=True)
class Finding:
    """Failures that are one: the same oracle, the same object, on the way to the same waypoint.

    ``example`` is the one with the smallest margin.
    """

    oracle: str
    object: str
    waypoint: str
    count: int
    example: PointResult
    evidence: Evidence


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
    """The least of the nearest failure that still fails, told in lines, with its files.

    ``files`` are those of a campaign that runs by itself, ``campaign.yaml`` among them. ``left``
    names in a few words what is left.
    """

    story: tuple[str, ...]
    minimal: bool
    runs: int
    files: tuple[BundledFile, ...] = ()
    left: str = ""


@dataclass(frozen=True, slots=True)
class SearchAnswer:
    """What a search has found, so far or in the end.

    ``ended`` says why it ended (``budget``, ``time``, ``failures``, ``settled``, ``errors``,
    ``exhausted``, ``cancelled``), empty while it lasts. Of the ``explored`` proposals ``refused``
    are points that no run can be made of. ``written`` is the scenario as it stands, ``first`` the
    failure of the lowest number, ``best`` the smallest margin. Of the ``space_filling`` runs, those
    with a verdict that were drawn without looking at results (the scenario as written was not
    drawn), ``space_filling_failed`` fail; with 95 % certainty at most ``failing_share`` of the
    space does. Of the failures that were explored, ``repeated`` were run with other noise as well,
    of which ``holding`` fail with most noises. ``unsought`` are failures of other oracles.
    ``sentences`` tell all of it; ``found`` is the text
    of ``NAME.found.yaml``, empty when nothing fails.
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
    failing_share: float | None
    written: PointResult | None = None
    first: PointResult | None = None
    best: PointResult | None = None
    confirmed: Confirmation | None = None
    nearest: NearestFailure | None = None
    shrunk: ShrunkScenario | None = None
    findings: tuple[Finding, ...] = ()
    influence: tuple[Influence, ...] = ()
    sentences: tuple[str, ...] = ()
    found: str = ""
    found_label: str = ""
    found_digest: str = ""
    refused: int = 0
    repeated: int = 0
    holding: int = 0
    unsought: tuple[UnsoughtFailure, ...] = ()


@dataclass(frozen=True, slots=True)
class SearchRow:
    """A search and how it stands; ``note`` says what keeps it or why it failed.

    ``campaign`` is its id in the ledger, ``proposed`` and ``finished`` count runs. ``file`` is the
    campaign file among its files.
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


@dataclass(frozen=True, slots=True)
class SearchQuery:
    """Searches, the newest first; all of them, or one, or those that still run."""

    campaign: IdText = ""
    running: bool = False


@dataclass(frozen=True, slots=True)
class SearchProgress:
    """What the coordinator says of a search: its phase, a note, the answer so far or in the end."""

    campaign: IdText
    phase: Phase
    note: Annotated[str, Field(max_length=2000)] = ""
    state: SearchState = "running"
    answer: SearchAnswer | None = None
