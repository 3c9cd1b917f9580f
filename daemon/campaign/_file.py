"""The keys of a campaign file, as they are written.

Comparisons and policies are sentences (``delay(S3.2 vs S3.5) <= 30 s``,
``rate >= 80 %``), so that no value starts with a sign that means something to YAML.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, TypeAlias

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    model_validator,
)

from daemon.campaign._names import LayerName, Names, OneName, References
from daemon.campaign._references import ReferenceText
from daemon.campaign._search_file import SearchText
from daemon.model.assessments import PolicyRule, RepeatPolicy
from daemon.model.search import SEARCH_NAME
from daemon.model.spec import MapSettings
from grammars.model.grid import MapRule
from grammars.model.misplaced_keys import MISSION_KEYS, ROBOT_KEYS
from grammars.text.documents import Duration, Length, OtherName, Ratio, StrictModel
from grammars.text.quantity import read_as

_MOST_REPEATS: Final = 100_000
"""As many as one submission of a campaign is tested with."""
_RATE: Final = re.compile(r"rate\s*>=\s*(?P<rate>[^<>=]+)")


def read_rule(text: str) -> tuple[PolicyRule, float]:
    """Read ``all``, ``mean`` or ``rate >= 80 %`` to a rule and its rate; raises ``ValueError``."""
    words = text.strip()
    if words in ("all", "mean"):
        return ("all", 1.0) if words == "all" else ("mean", 1.0)
    found = _RATE.fullmatch(words)
    if found is None:
        raise ValueError(f'"{text}" is not a rule: write all, mean or rate >= 80 %')
    rate = read_as(found["rate"].strip(), "ratio")
    # No finite number of passes excludes a rate just below 100 %; "all" says what can be said.
    if not 0.0 < rate < 1.0:
        raise ValueError(
            f"no number of runs shows a rate of {found['rate'].strip()}: "
            "write one above 0 and below 100 %, or all"
        )
    return "rate", rate


def _check_rule(text: str) -> str:
    read_rule(text)
    return text


def _repeats_mapping(value: Any) -> Any:
    """Take a plain number of repeats for ``{n: number}``."""
    # bool is an int to Python: "repeats: true" would be one run.
    if isinstance(value, bool) or not isinstance(value, int | dict):
        raise ValueError("must be a whole number, or {n: 5, pass: rate >= 80 %}")
    return {"n": value} if isinstance(value, int) else value


class _RepeatsText(StrictModel):
    """How often every cell is run, and when all its runs together pass."""

    n: int = Field(ge=1, le=_MOST_REPEATS)
    """Runs of every scenario; the same repeat sees the same noise in each of them."""
    rule: Annotated[str, AfterValidator(_check_rule)] = Field(default="all", alias="pass")
    """all: every run passes; rate >= 80 %: it is shown that so many do (exact, 95 %);
    mean: it is shown that the mean margin is not below 0 (t, 95 %)."""
    until: Literal["decided"] | None = None
    """decided: cells that are neither shown to pass nor to fail get more runs, up to at-most."""
    at_most: int | None = Field(default=None, ge=1, le=_MOST_REPEATS, alias="at-most")
    """So many runs of a cell and no more; needed with "until: decided"."""

    @model_validator(mode="after")
    def _sensible(self) -> _RepeatsText:
        rule, _ = read_rule(self.rule)
        if (self.until is None) != (self.at_most is None):
            raise ValueError('"until: decided" and "at-most" need each other')
        if self.at_most is not None and self.at_most <= self.n:
            raise ValueError(f'"at-most: {self.at_most}" leaves nothing to add to n: {self.n}')
        if self.until and rule == "all":
            raise ValueError(
                '"until: decided" needs "pass: rate >= 80 %" or "pass: mean": '
                "the first run that fails decides all"
            )
        if rule == "mean" and self.n < 2:
            raise ValueError('"pass: mean" needs n: 2 or more, one run does not say how they vary')
        return self


RepeatsText: TypeAlias = Annotated[
    _RepeatsText, BeforeValidator(_repeats_mapping, json_schema_input_type=int | _RepeatsText)
]
ONCE: Final = _RepeatsText(n=1)


def repeat_policy(text: _RepeatsText) -> RepeatPolicy:
    """Return the policy that ``repeats:`` means."""
    rule, rate = read_rule(text.rule)
    return RepeatPolicy(text.n, rule, rate, text.until is not None, text.at_most or text.n)


_CAMPAIGN_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,59}$"
_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$"

_OF_DOORS: Final = (
    'what stands there is said by scenery layers: "objects:" names those with the models and their '
    'places, "behaviours:" those that say what they do'
)
SYNONYMS: Final[dict[str, str | OtherName]] = {
    "description": OtherName("about"),
    "duration": OtherName("limit"),
    "timeout": OtherName("limit"),
    "runs": OtherName("repeats", ", at the top of the campaign file"),
    "stack": OtherName("sut", ", for system under test"),
    "doors": _OF_DOORS,
    "people": _OF_DOORS,
    "scenery": _OF_DOORS,
    **dict.fromkeys(("building", "environment", "plan", "world"), OtherName("floorplan")),
}
"""What people call keys of campaigns and scenarios that are called otherwise here."""


class ExpectText(StrictModel):
    """What is known to be otherwise than passing; an unexpected pass is reported too."""

    scenario: str = "*"
    """Name of a scenario, or a pattern such as S3.*; all when left out."""
    oracle: str = "*"
    """Name of an oracle or of a comparison, or a pattern; all when left out."""
    sut: Names = Field(default_factory=list)
    """Systems under test, names or patterns; all when left out."""
    verdict: Literal["pass", "fail", "mixed", "any"]
    """pass; fail: in every run; mixed: in at least one run; any: whatever comes out."""
    why: str = Field(min_length=1)
    """Why this is so; it is shown beside the verdict."""

    @model_validator(mode="after")
    def _about_something(self) -> ExpectText:
        if self.scenario == self.oracle == "*":
            raise ValueError('name a "scenario" or an "oracle" it is about')
        return self


class AllowText(StrictModel):
    """A warning of the check that is meant, and is not said any more."""

    warning: str = Field(min_length=1)
    """The warning as it is said, * for whatever stands there: the leaf of door_12 sweeps *."""
    why: str = Field(min_length=1)
    """Why it is meant."""


class GateText(StrictModel):
    """Fail when results get worse than those of another campaign."""

    baseline: str = Field(min_length=1)
    """Id or name of a campaign, a JSON file of results, or last-green: the newest earlier run of
    this campaign in which everything was as expected."""
    worse_by: Ratio = Field(alias="worse-by", ge=0.0)
    """By how much a margin or the duration may get worse, such as 10 %."""


class MapText(StrictModel):
    """The map handed to the system under test."""

    resolution: Length = Field(default=0.05, ge=0.01, le=0.5)
    """Edge of a cell."""
    doors: Literal["none", "initial"] = "none"
    """none: without objects, as a surveyor would draw it; initial: as they stand at the start."""
    rule: MapRule = "outline"
    """Which cells a wall takes. outline: as maps of published plans are drawn, through the cells
    of its corners; touch: each that it overlaps; centre: those whose centre it covers."""
    file: str = Field(default="", min_length=1)
    """A map of one's own instead: its map_server YAML, relative to the campaign file."""

    @model_validator(mode="after")
    def _drawn_or_given(self) -> MapText:
        drawing = sorted(self.model_fields_set - {"file"})
        if self.file and drawing:
            raise ValueError(
                f'"file" gives a map as it is, "{drawing[0]}" is about drawing one: leave one out'
            )
        return self

    def settings(self) -> MapSettings:
        return MapSettings(self.resolution, self.doors, self.rule)


Chance: TypeAlias = Literal["per repeat", "per campaign"]


class VaryText(StrictModel):
    """Run in variants of the floor plan."""

    model_config = ConfigDict(
        json_schema_extra={
            "anyOf": [
                {"required": ["samples"]},
                {"required": ["cover"], "properties": {"cover": {"const": "grid"}}},
            ]
        }
    )

    floorplan: LayerName
    """A variation layer: NAME.variation beside this file. NAME: {draw: value} fixes draws."""
    samples: int | None = Field(default=None, ge=1, le=10_000)
    """How many variants; a grid knows it itself."""
    cover: Literal["random", "grid", "halton", "lhs"] = "random"
    """How variants are spread over what may vary; lhs is a Latin hypercube."""
    seed: int | None = Field(default=None, ge=0, lt=2**32)
    """Seed of the variants; that of the campaign when left out."""

    @model_validator(mode="after")
    def _countable(self) -> VaryText:
        if self.samples is None and self.cover != "grid":
            raise ValueError(f'"cover: {self.cover}" needs a number of "samples"')
        return self


class SlotsText(StrictModel):
    """What a scenario is made of."""

    floorplan: LayerName | None = Field(default=None, examples=["flat"])
    """A floor plan: NAME.fpm, or a walls layer NAME.walls.yaml, beside this file or in floorplans/.
    NAME: {variable: value} gives variables of a plan other values."""
    objects: References | None = Field(default=None, examples=["doors"])
    """Scenery layers with object models and their places: NAME.scenery here or in scenery/.
    NAME: {parameter: value} sets parameters of a layer."""
    behaviours: References | None = Field(default=None, examples=["doors_open"])
    """Scenery layers that say what objects do; later ones win. NAME: {parameter: value} sets
    parameters of a layer."""
    mission: LayerName | None = Field(default=None, examples=["courier"])
    """A mission: NAME.mission.yaml here or in missions/. NAME: {key: value} gives keys of the
    file other values, such as courier: {start.y: 0.1 m}."""
    without: Names | None = Field(default=None, examples=[["kitchen_door", "waypoint 3"]])
    """Parts that are left out after everything is composed: an object by its name, waypoint NAME or
    waypoint 3, behaviour of NAME."""
    robot: LayerName | None = Field(default=None, examples=["courier"])
    """Another robot than the campaign's. NAME: {key: value} gives keys of the file other values,
    such as courier: {laser.noise: 2 cm}."""
    sut: References | None = Field(default=None, examples=["pilot"])
    """Other systems under test than the campaign's. NAME: {parameter: value} sets parameters."""
    oracles: Names | None = Field(default=None, examples=[["reached", "no-contact"]])
    """Which oracles judge this scenario, by their names in the layers of the campaign."""
    map: MapText | None = Field(default=None, examples=[{"file": "office.yaml"}])
    vary: VaryText | None = Field(default=None, examples=[{"floorplan": "flat", "samples": 20}])
    chance: Chance | None = None
    """Whether random behaviours are drawn anew for each repeat or once."""
    limit: Duration | None = Field(default=None, gt=0)
    """Simulated time a run of this scenario may take."""


class DefaultsText(SlotsText):
    """What holds for every scenario that does not say otherwise, itself or by "like"."""

    elsewhere = MISSION_KEYS | dict.fromkeys(
        ("about", "like", "abstract", "behaviours+", "oracles+"), "it belongs in a scenario"
    )


class ScenarioText(SlotsText):
    """One scenario: the layers that make it."""

    elsewhere: ClassVar[Mapping[str, str | OtherName]] = {
        **MISSION_KEYS,
        **dict.fromkeys(
            ("seed", "repeats", "compare", "expect", "allow", "reference", "gate", "defaults"),
            "it belongs at the top of the campaign file, it is about all scenarios",
        ),
        "matrix": "it belongs at the top of the campaign file; here write: sut: [pilot]",
        **SYNONYMS,
    }

    about: str = ""
    """One line for people."""
    like: OneName | None = None
    """Another scenario of this file: this one is the same except for what is written here."""
    abstract: bool = False
    """Never run itself, only for others to be like."""
    more_behaviours: References | None = Field(default=None, alias="behaviours+")
    """Behaviours on top of those of the scenario this one is like."""
    more_oracles: Names | None = Field(default=None, alias="oracles+")
    """Oracles on top of those of the scenario this one is like."""


class _MatrixText(StrictModel):
    """What every scenario is run with, in turn."""

    elsewhere = dict.fromkeys(
        ("robot", "floorplan", "mission"), 'only "sut" has several values here: a scenario for each'
    )

    sut: References = Field(examples=[["pilot"]])
    """Systems under test: NAME.yaml here or in suts/, the name of a kind, or one that ships.
    NAME: {parameter: value} sets parameters."""


class CampaignFile(StrictModel):
    """The keys of a campaign file."""

    elsewhere: ClassVar[Mapping[str, str | OtherName]] = {
        **MISSION_KEYS,
        **ROBOT_KEYS,
        **dict.fromkeys(("kind", "ros", "parameters"), "it belongs in a SUT file: suts/NAME.yaml"),
        **{
            key: f'it belongs in a scenario, or under "defaults:" for all of them: {key}: {example}'
            for key, example in (
                ("floorplan", "flat"),
                ("objects", "doors"),
                ("behaviours", "doors_open"),
                ("mission", "courier"),
                ("without", "kitchen_door"),
            )
        },
        **dict.fromkeys(
            ("like", "abstract", "behaviours+", "oracles+"),
            "it belongs in a scenario, below its name",
        ),
        "sut": "for all scenarios write: matrix: {sut: [pilot]}",
        "name": 'the name of a campaign is the value of "campaign:"',
        **SYNONYMS,
    }

    campaign: str = Field(pattern=_CAMPAIGN_NAME, examples=["courier-tests"])
    """Name of the campaign."""
    about: str = ""
    """One line for people."""
    seed: int = Field(default=0, ge=0, lt=2**63)
    """The only source of chance: the same seed gives the same runs, byte for byte."""
    repeats: RepeatsText = ONCE
    """Runs of every scenario, a number or {n: 5, pass: rate >= 80 %}; the same repeat sees the
    same noise in each of them. When left out 1, and 5 with a system that is not repeatable."""
    limit: Duration = Field(gt=0, le=86_400, examples=["3 min"])
    """Simulated time a run may take."""
    robot: LayerName | None = Field(default=None, examples=["courier"])
    """A robot: NAME.yaml beside this file or in robots/, or one that ships. NAME: {key: value}
    gives keys of the file other values."""
    matrix: _MatrixText | None = Field(default=None, examples=[{"sut": ["pilot"]}])
    oracles: Names | None = Field(default=None, examples=["navigation"])
    """Oracle layers, of which scenarios name lines: NAME.oracles.yaml beside this file or in
    oracles/."""
    map: MapText = Field(default=MapText(), examples=[{"doors": "initial"}])
    vary: VaryText | None = Field(default=None, examples=[{"floorplan": "flat", "samples": 20}])
    defaults: DefaultsText = DefaultsText()
    """What holds for every scenario that does not say otherwise, itself or by "like": any key of a
    scenario."""
    chance: Chance = "per repeat"
    """Whether random behaviours are drawn anew for each repeat or once."""
    scenarios: dict[Annotated[str, Field(pattern=_NAME)], ScenarioText] = Field(min_length=1)
    """The scenarios by name."""
    search: dict[Annotated[str, Field(pattern=SEARCH_NAME)], SearchText] = Field(
        default_factory=dict
    )
    """Searches by name, for what makes a scenario fail: they run when they are asked for."""
    compare: dict[Annotated[str, Field(pattern=_NAME)], str] = Field(default_factory=dict)
    """Comparisons of scenarios by name, paired by repeat: delay(S3.2 vs S3.5) <= 30 s, with
    "on leg NAME" inside for one leg only; a measure's name instead of delay compares that."""
    expect: list[ExpectText] = Field(default_factory=list)
    """What is known to be otherwise than passing, and why; all else must pass."""
    allow: list[AllowText] = Field(default_factory=list)
    """Warnings of the check that are meant, and why; errors cannot be allowed."""
    reference: dict[Annotated[str, Field(pattern=_NAME)], ReferenceText] = Field(
        default_factory=dict
    )
    """What somebody else found of the same, by a short name such as paper: marks in the figures
    of the report and a column in its tables. No verdict follows from it."""
    gate: GateText | None = None
    """Results that must not get worse than those of another campaign."""
