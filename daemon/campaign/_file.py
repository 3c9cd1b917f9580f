"""The keys of a campaign file, as people write them.

Policies are sentences (``rate >= 80 %``), so that no value starts with a special sign of YAML.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, TypeAlias

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from daemon.campaign._search_file import SearchText, checked
from daemon.model.assessments import PolicyRule, RepeatPolicy
from daemon.model.search import SEARCH_NAME
from daemon.model.spec import MapSettings
from grammars.model.grid import MapRule
from grammars.model.robot_files import MISSION_KEYS, ROBOT_KEYS
from grammars.text.documents import (
    ONE_OR_MORE,
    OtherName,
    StrictModel,
    as_list,
    text_or,
    wrong_form,
)
from grammars.text.quantity import Duration, Length, Ratio, read_as

_CAMPAIGN_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,59}$"
_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$"

_OF_DOORS: Final = (
    'scenery layers describe the objects: "objects:" names layers with the models and their '
    'places, "behaviours:" layers with their motion'
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
"""Other names by which people know keys of campaigns and scenarios."""

Overrides: TypeAlias = dict[str, Any]
_OneLayer: TypeAlias = Annotated[
    dict[str, Overrides], Field(json_schema_extra={"minProperties": 1, "maxProperties": 1})
]


def _layer(value: Any) -> Any:
    """Check the name of a layer, alone or with overrides; raises ``ValueError`` in plain words."""
    if isinstance(value, str):
        return value
    if isinstance(value, list):
        raise ValueError("takes one layer here, not a list: write its name without brackets")
    if isinstance(value, bool | int | float):
        # YAML made a number or a flag of a name: the reader of the error says how to write it.
        raise PydanticCustomError("string_type", "must be text")
    if not isinstance(value, dict) or not value:
        raise ValueError("must be NAME or NAME: {parameter: value}, not nothing")
    for name, overrides in value.items():
        if overrides is None:
            raise ValueError(f'"{name}:" has no values behind it: without any, write {name}')
        if not isinstance(overrides, dict):
            text = " ".join(str(overrides).split())[:40]
            raise ValueError(f"write {name}: {{parameter: value}}, not {name}: {text}")
    return value


LayerName: TypeAlias = Annotated[
    str | dict[str, Overrides],
    # A union would report each of its members, in terms of Python.
    PlainValidator(_layer, json_schema_input_type=str | _OneLayer),
]


def _name_alone(value: Any) -> Any:
    """Return a name; raises for lists, keys and ``null``, the likely mistakes."""
    if isinstance(value, list):
        raise wrong_form("takes one name, not a list: write it without brackets")
    if isinstance(value, dict):
        raise wrong_form("takes a name, not keys: its definition is written elsewhere")
    if value is None:
        raise wrong_form("names nothing")
    return value


def _no_mapping(value: Any) -> Any:
    if isinstance(value, dict):
        raise wrong_form("takes names, not keys: their definitions are written elsewhere")
    return value


OneName: TypeAlias = Annotated[str, BeforeValidator(_name_alone, json_schema_input_type=str)]
Names: TypeAlias = Annotated[list[OneName], ONE_OR_MORE, BeforeValidator(_no_mapping)]
References: TypeAlias = Annotated[
    list[LayerName], BeforeValidator(as_list, json_schema_input_type=LayerName | list[LayerName])
]


class MapText(StrictModel):
    """The map handed to the system under test."""

    resolution: Length = Field(default=0.05, ge=0.01, le=0.5)
    """Edge of a cell."""
    doors: Literal["none", "initial"] = "none"
    """none: without objects, as a surveyor would draw it; initial: with doors as at the start."""
    rule: MapRule = "outline"
    """Cells that a wall occupies. outline: through the cells of its corners, as in maps of
    published plans; touch: every cell that it overlaps; centre: cells whose centre it covers."""
    file: str = Field(default="", min_length=1)
    """Your own map instead: its map_server YAML, relative to the campaign file."""

    @model_validator(mode="after")
    def _drawn_or_given(self) -> MapText:
        drawing = sorted(self.model_fields_set - {"file"})
        if self.file and drawing:
            raise ValueError(
                f'"file" names a finished map, "{drawing[0]}" is for drawing one: leave one out'
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
    """Number of variants; not needed with a grid."""
    cover: Literal["random", "grid", "halton", "lhs"] = "random"
    """Distribution of the variants over the ranges; lhs is a Latin hypercube."""
    seed: int | None = Field(default=None, ge=0, lt=2**32)
    """Seed of the variants; by default that of the campaign."""

    @model_validator(mode="after")
    def _countable(self) -> VaryText:
        if self.samples is None and self.cover != "grid":
            raise ValueError(f'"cover: {self.cover}" needs a number of "samples"')
        return self


class _FilledModel(StrictModel):
    """A model in which a key without a value is an error: it may be meant to take one away."""

    @field_validator("*", mode="before")
    @classmethod
    def _filled(cls, value: Any) -> Any:
        if value is None:
            raise wrong_form("has no value: write one, or remove the line")
        return value


class SlotsText(_FilledModel):
    """Layers and settings of a scenario."""

    floorplan: LayerName | None = Field(default=None, examples=["flat"])
    """A floor plan: NAME.fpm, or a walls layer NAME.walls.yaml, beside this file or in floorplans/.
    NAME: {variable: value} gives variables of a plan other values."""
    objects: References | None = Field(default=None, examples=["doors"])
    """Scenery layers with object models and their places: NAME.scenery here or in scenery/.
    NAME: {parameter: value} sets parameters of a layer."""
    behaviours: References | None = Field(default=None, examples=["doors_open"])
    """Scenery layers with the motion of objects; later ones win. NAME: {parameter: value} sets
    parameters of a layer."""
    mission: LayerName | None = Field(default=None, examples=["courier"])
    """A mission: NAME.mission.yaml here or in missions/. NAME: {start.y: 0.1 m} gives keys of the
    file other values."""
    without: Names | None = Field(default=None, examples=[["kitchen_door", "waypoint 3"]])
    """Parts to leave out of the composed world: an object by its name, waypoint NAME or waypoint 3,
    behaviour of NAME."""
    robot: LayerName | None = Field(default=None, examples=["courier"])
    """Another robot than the campaign's; courier: {laser.noise: 2 cm} gives keys of its file other
    values."""
    sut: References | None = Field(default=None, examples=["pilot"])
    """Other systems under test than the campaign's. NAME: {parameter: value} sets parameters."""
    oracles: Names | None = Field(default=None, examples=[["reached", "no-contact"]])
    """Oracles that judge this scenario, by their names in the layers of the campaign."""
    map: MapText | None = Field(default=None, examples=[{"file": "office.yaml"}])
    vary: VaryText | None = Field(default=None, examples=[{"floorplan": "flat", "samples": 20}])
    chance: Chance | None = None
    """Whether random behaviours are drawn anew for each repeat or once."""
    limit: Duration | None = Field(default=None, gt=0)
    """Most simulated time of a run of this scenario."""


class DefaultsText(SlotsText):
    """Layers and settings of every scenario without its own, written there or by "like"."""

    elsewhere = MISSION_KEYS | dict.fromkeys(
        ("about", "like", "abstract", "behaviours+", "oracles+"), "it belongs in a scenario"
    )


class ScenarioText(SlotsText):
    """One scenario and its layers."""

    elsewhere: ClassVar[Mapping[str, str | OtherName]] = {
        **MISSION_KEYS,
        **dict.fromkeys(
            ("seed", "repeats", "compare", "expect", "allow", "reference", "gate", "defaults"),
            "it belongs at the top of the campaign file, it holds for all scenarios",
        ),
        "matrix": "it belongs at the top of the campaign file; here write: sut: [pilot]",
        **SYNONYMS,
    }

    about: str = ""
    """One line for people."""
    like: OneName | None = None
    """Another scenario of this file: this one is the same except for the keys written here."""
    abstract: bool = False
    """Never run, only a base for others that are "like" it."""
    more_behaviours: References | None = Field(default=None, alias="behaviours+")
    """Behaviours added to those of the base scenario."""
    more_oracles: Names | None = Field(default=None, alias="oracles+")
    """Oracles added to those of the base scenario."""


class _MatrixText(StrictModel):
    """Systems with which every scenario is run, in turn."""

    elsewhere = dict.fromkeys(
        ("robot", "floorplan", "mission"),
        'only "sut" has several values here: write a scenario for each',
    )

    sut: References = Field(examples=[["pilot"]])
    """Systems under test: NAME.yaml here or in suts/, the name of a kind, or a shipped one.
    NAME: {parameter: value} sets parameters."""


_MOST_REPEATS: Final = 100_000
"""Largest number that tests submit in one campaign."""
_RATE: Final = re.compile(r"rate\s*>=\s*(?P<rate>[^<>=]+)")


def read_rule(text: str) -> tuple[PolicyRule, float]:
    """Read ``all``, ``mean`` or ``rate >= 80 %``; return rule and rate; raises ``ValueError``."""
    words = text.strip()
    if words in ("all", "mean"):
        return ("all", 1.0) if words == "all" else ("mean", 1.0)
    rule = _RATE.fullmatch(words)
    if rule is None:
        raise ValueError(f'"{text}" is not a rule: write all, mean or rate >= 80 %')
    rate = read_as(rule["rate"].strip(), "ratio")
    # No finite number of passes excludes a rate just below 100 %; "all" is the closest rule.
    if not 0.0 < rate < 1.0:
        raise ValueError(
            f"no number of runs shows a rate of {rule['rate'].strip()}: "
            "write one above 0 and below 100 %, or all"
        )
    return "rate", rate


def _repeats_mapping(value: Any) -> Any:
    """Turn a plain number of repeats into ``{n: number}``."""
    # bool is an int in Python: "repeats: true" would be one run.
    if isinstance(value, bool) or not isinstance(value, int | dict):
        raise ValueError("must be a whole number, or {n: 20, pass: rate >= 80 %}")
    if isinstance(value, int) and not 1 <= value <= _MOST_REPEATS:
        raise ValueError(f"{value} is not a number of runs from 1 to {_MOST_REPEATS}")
    return {"n": value} if isinstance(value, int) else value


class _RepeatsText(StrictModel):
    """Number of runs of every cell, and the rule by which they pass together."""

    n: int = Field(ge=1, le=_MOST_REPEATS)
    """Runs of every scenario."""
    rule: Annotated[str, checked(read_rule)] = Field(default="all", alias="pass")
    """all: every run passes; rate >= 80 %: the runs show this pass rate (exact, 95 %);
    mean: the runs show that the mean margin is not below 0 (t, 95 %)."""
    until: Literal["decided"] | None = None
    """decided: cells shown neither to pass nor to fail get more runs, up to at-most."""
    at_most: int | None = Field(default=None, ge=1, le=_MOST_REPEATS, alias="at-most")
    """Most runs of a cell; required with "until: decided"."""

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
    """Return the policy of ``repeats:``."""
    rule, rate = read_rule(text.rule)
    return RepeatPolicy(text.n, rule, rate, text.until is not None, text.at_most or text.n)


class ExpectText(StrictModel):
    """An expected verdict, and why; an unexpected pass is reported too."""

    scenario: str = "*"
    """Name of a scenario, or a pattern such as S3.*; by default all."""
    oracle: str = "*"
    """Name of an oracle or of a comparison, or a pattern; by default all."""
    sut: Names = Field(default_factory=list)
    """Systems under test, names or patterns; by default all."""
    verdict: Literal["pass", "fail", "mixed", "any"]
    """pass; fail: a failure in every run; mixed: in at least one run; any: no expectation."""
    why: str = Field(min_length=1)
    """The reason, shown beside the verdict."""

    @model_validator(mode="after")
    def _about_something(self) -> ExpectText:
        if self.scenario == self.oracle == "*":
            raise ValueError('name its "scenario" or its "oracle"')
        return self


class AllowText(StrictModel):
    """An intended situation whose warning the check leaves out."""

    warning: str = Field(min_length=1)
    """The text of the warning, * for any text: the leaf of door_12 sweeps *."""
    why: str = Field(min_length=1)
    """Why this is intended."""


class GateText(StrictModel):
    """Fail when results get worse than those of another campaign."""

    baseline: str = Field(min_length=1)
    """Id or name of a campaign, a JSON file of results, or last-green: the newest earlier run of
    this campaign in which everything was as expected."""
    worse_by: Ratio = Field(alias="worse-by", ge=0.0, examples=["10 %"])
    """Share by which a margin or the duration may get worse, such as 10 %."""


# A count needs no unit, and so no quotes.
_Amount: TypeAlias = Annotated[str, text_or(int, float)]


class ValueText(StrictModel):
    """One value of a source."""

    scenario: str = ""
    """Name of a scenario, or a pattern such as S3.*; left out for a comparison."""
    sut: Names = Field(default_factory=list)
    """Systems under test, names or patterns; by default all."""
    oracle: str = Field(min_length=1)
    """Name of a measure, of an oracle, or of a comparison; duration always exists."""
    value: _Amount
    """Value with the unit of the measure, such as 696.08 s; for an oracle with a limit the number
    of passes, such as 3 of 5."""
    statistic: Literal["mean", "median", "min", "max"] = "mean"
    """Statistic of the source over its runs."""
    deviation: _Amount | None = None
    """Standard deviation of the runs."""
    range: Annotated[list[_Amount], Field(min_length=2, max_length=2)] | None = None
    """Least and greatest value, or the bounds of an interval."""
    runs: int | None = Field(default=None, ge=1)
    """Number of runs behind the value."""
    note: str = ""
    """Place in the source, and other remarks."""


class ReferenceText(StrictModel):
    """Values of one source."""

    source: str = Field(min_length=1)
    """Author and place of publication, shown beside the values."""
    values: list[ValueText] = Field(min_length=1)
    """The values, one for each scenario, system and quantity."""


class CampaignFile(_FilledModel):
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
        "": 'a scenario is written below "scenarios:", indented',
    }

    campaign: str = Field(pattern=_CAMPAIGN_NAME, examples=["courier-tests"])
    """Name of the campaign."""
    about: str = ""
    """One line for people."""
    seed: int = Field(default=0, ge=0, lt=2**63)
    """The only source of chance: the same seed gives the same runs, byte for byte."""
    repeats: RepeatsText = ONCE
    """Runs of every scenario, a number or {n: 20, pass: rate >= 80 %}. By default 1, and 5 with a
    system that is not repeatable."""
    limit: Duration = Field(gt=0, le=86_400, examples=["3 min"])
    """Most simulated time of a run."""
    robot: LayerName | None = Field(default=None, examples=["courier"])
    """A robot: NAME.yaml beside this file or in robots/, or a shipped one. NAME: {key: value}
    gives keys of the file other values."""
    matrix: _MatrixText | None = Field(default=None, examples=[{"sut": ["pilot"]}])
    oracles: Names | None = Field(default=None, examples=["navigation"])
    """Oracle layers whose lines scenarios name: NAME.oracles.yaml beside this file or in
    oracles/."""
    map: MapText = Field(default=MapText(), examples=[{"doors": "initial"}])
    vary: VaryText | None = Field(default=None, examples=[{"floorplan": "flat", "samples": 20}])
    defaults: DefaultsText = DefaultsText()
    """Any key of a scenario, for every scenario without that key, written there or by "like"."""
    chance: Chance = "per repeat"
    """Whether random behaviours are drawn anew for each repeat or once."""
    scenarios: dict[Annotated[str, Field(pattern=_NAME)], ScenarioText] = Field(min_length=1)
    """The scenarios by name."""
    search: dict[Annotated[str, Field(pattern=SEARCH_NAME)], SearchText] = Field(
        default_factory=dict
    )
    """Searches by name, for causes of failures of a scenario; they run on demand."""
    compare: dict[Annotated[str, Field(pattern=_NAME)], str] = Field(default_factory=dict)
    """Comparisons of scenarios by name, paired by repeat: delay(S3.2 vs S3.5) <= 30 s, also "on leg
    NAME"; the name of a measure instead of delay compares that."""
    expect: list[ExpectText] = Field(
        default_factory=list, examples=[[{"oracle": "reached", "verdict": "fail", "why": "..."}]]
    )
    """Expected verdicts other than pass, and why; everything else must pass."""
    allow: list[AllowText] = Field(default_factory=list)
    """Warnings of the check that are intended, and why; errors cannot be allowed."""
    reference: dict[Annotated[str, Field(pattern=_NAME)], ReferenceText] = Field(
        default_factory=dict
    )
    """Published values of the same quantities, by a short name such as paper, for the report; they
    change no verdict."""
    gate: GateText | None = None
    """Results that must not get worse than those of another campaign."""
