"""The campaign file as written: its keys, scenarios and what they inherit, expected results.

Every value names a layer file; a scenario that is ``like`` another is that scenario except for
the slots written here. ``oracles`` and ``behaviours`` replace the inherited list, ``oracles+`` and
``behaviours+`` add to it. Comparisons and policies are sentences (``delay(S3.2 vs S3.5) <= 30 s``,
``rate >= 80 %``), so that no value starts with a sign that means something to YAML.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from daemon.campaign._references import ReferenceText
from daemon.model.assessments import PolicyRule, RepeatPolicy
from daemon.model.spec import MapSettings
from grammars.model.grid import MapRule
from grammars.text.diagnostics import Diagnostic, InputError, Where, did_you_mean
from grammars.text.documents import (
    Duration,
    Length,
    Ratio,
    StrictModel,
    YamlDocument,
)
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
Overrides: TypeAlias = dict[str, Any]
_OneLayer: TypeAlias = Annotated[
    dict[str, Overrides], Field(json_schema_extra={"minProperties": 1, "maxProperties": 1})
]
LayerName: TypeAlias = str | _OneLayer


def _as_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


_Names: TypeAlias = Annotated[
    list[str], BeforeValidator(_as_list, json_schema_input_type=str | list[str])
]
_References: TypeAlias = Annotated[
    list[LayerName], BeforeValidator(_as_list, json_schema_input_type=LayerName | list[LayerName])
]


class ExpectText(StrictModel):
    """What is known to be otherwise than passing; a surprise pass is reported too."""

    scenario: str = "*"
    """Name of a scenario, or a pattern such as S3.*; all when left out."""
    oracle: str = "*"
    """Name of an oracle or of a comparison, or a pattern; all when left out."""
    sut: _Names = Field(default_factory=list)
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


class GateText(StrictModel):
    """Fail when results get worse than those of another campaign."""

    baseline: str = Field(min_length=1)
    """Id or name of a campaign, a JSON file of results, or last-green: the newest earlier run of
    this campaign in which everything was as expected."""
    worse_by: Ratio = Field(alias="worse-by", ge=0.0)
    """By how much a margin or the duration may get worse, such as 10 %."""


class _MapText(StrictModel):
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
    def _drawn_or_given(self) -> _MapText:
        drawing = sorted(self.model_fields_set - {"file"})
        if self.file and drawing:
            raise ValueError(
                f'"file" gives a map as it is, "{drawing[0]}" is about drawing one: leave one out'
            )
        return self

    def settings(self) -> MapSettings:
        return MapSettings(self.resolution, self.doors, self.rule)


_Chance: TypeAlias = Literal["per repeat", "per campaign"]


class _VaryText(StrictModel):
    """Run in variants of the floor plan."""

    model_config = ConfigDict(
        json_schema_extra={
            "anyOf": [
                {"required": ["samples"]},
                {"required": ["cover"], "properties": {"cover": {"enum": ["grid", "pairwise"]}}},
            ]
        }
    )

    floorplan: str
    """A variation layer: NAME.variation beside this file."""
    samples: int | None = Field(default=None, ge=1, le=10_000)
    """How many variants; grid and pairwise know it themselves."""
    cover: Literal["random", "grid", "halton", "lhs", "pairwise"] = "random"
    """How variants are spread over what may vary; lhs is a Latin hypercube."""
    seed: int | None = Field(default=None, ge=0, lt=2**32)
    """Seed of the variants; that of the campaign when left out."""

    @model_validator(mode="after")
    def _countable(self) -> _VaryText:
        if self.samples is None and self.cover not in ("grid", "pairwise"):
            raise ValueError(f'"cover: {self.cover}" needs a number of "samples"')
        return self


class _ScenarioText(StrictModel):
    """One scenario: the layers that make it."""

    about: str = ""
    """One line for people."""
    like: str | None = None
    """Another scenario of this file: this one is the same except for what is written here."""
    abstract: bool = False
    """Never run itself, only for others to be like."""
    floorplan: LayerName | None = None
    """A floor plan: NAME.fpm beside this file or in floorplans/. NAME: {variable: value} gives
    variables of the plan other values."""
    objects: _Names | None = None
    """Scenery layers with object models and their places: NAME.scenery here or in scenery/."""
    behaviours: _References | None = None
    """Scenery layers that say what objects do; later ones win. NAME: {parameter: value} sets
    parameters of a layer."""
    more_behaviours: _References | None = Field(default=None, alias="behaviours+")
    """Behaviours on top of those of the scenario this one is like."""
    mission: str | None = None
    """A mission: NAME.mission.yaml here or in missions/."""
    robot: str | None = None
    """Another robot than the campaign's."""
    sut: _Names | None = None
    """Other systems under test than the campaign's."""
    oracles: _Names | None = None
    """Which oracles judge this scenario, by their names in the layers of the campaign."""
    more_oracles: _Names | None = Field(default=None, alias="oracles+")
    """Oracles on top of those of the scenario this one is like."""
    map: _MapText | None = None
    vary: _VaryText | None = None
    chance: _Chance | None = None
    """Whether random behaviours are drawn anew for each repeat or once."""
    limit: Duration | None = Field(default=None, gt=0)
    """Simulated time a run of this scenario may take."""


class _MatrixText(StrictModel):
    """What every scenario is run with, in turn."""

    sut: _Names
    """Systems under test: NAME.yaml here or in suts/, or the name of a kind."""


class CampaignFile(StrictModel):
    """The keys of a campaign file."""

    campaign: str = Field(pattern=_CAMPAIGN_NAME)
    """Name of the campaign."""
    about: str = ""
    """One line for people."""
    seed: int = Field(default=0, ge=0, lt=2**63)
    """The only source of chance: the same seed gives the same runs, byte for byte."""
    repeats: RepeatsText = ONCE
    """Runs of every scenario, a number or {n: 5, pass: rate >= 80 %}; the same repeat sees the
    same noise in each of them. When left out 1, and 5 with a system that is not repeatable."""
    limit: Duration = Field(gt=0, le=86_400)
    """Simulated time a run may take."""
    robot: str | None = None
    """A robot: NAME.yaml beside this file or in robots/."""
    matrix: _MatrixText | None = None
    oracles: _Names | None = None
    """Oracle layers: NAME.oracles.yaml beside this file or in oracles/."""
    map: _MapText = _MapText()
    vary: _VaryText | None = None
    chance: _Chance = "per repeat"
    """Whether random behaviours are drawn anew for each repeat or once."""
    scenarios: dict[Annotated[str, Field(pattern=_NAME)], _ScenarioText] = Field(min_length=1)
    """The scenarios by name."""
    compare: dict[Annotated[str, Field(pattern=_NAME)], str] = Field(default_factory=dict)
    """Comparisons of scenarios by name, paired by repeat: delay(S3.2 vs S3.5) <= 30 s, with
    "on leg NAME" inside for one leg only; a measure's name instead of delay compares that."""
    expect: list[ExpectText] = Field(default_factory=list)
    """What is known to be otherwise than passing, and why; all else must pass."""
    reference: dict[Annotated[str, Field(pattern=_NAME)], ReferenceText] = Field(
        default_factory=dict
    )
    """What somebody else found of the same, by a short name such as paper: marks in the figures
    of the report and a column in its tables. No verdict follows from it."""
    gate: GateText | None = None
    """Results that must not get worse than those of another campaign."""


@dataclass(frozen=True, slots=True)
class LayerReference:
    """A layer by name, with the overrides written beside it and where it stands."""

    name: str
    overrides: Overrides
    where: Where


@dataclass(frozen=True, slots=True)
class PlanVariation:
    """Run the scenario in variants of its floor plan: ``floorplan`` names a variation layer."""

    floorplan: LayerReference
    samples: int | None
    cover: Literal["random", "grid", "halton", "lhs", "pairwise"]
    seed: int


@dataclass(frozen=True, slots=True)
class ResolvedScenario:
    """A scenario after inheritance: every slot filled, nothing loaded yet.

    ``chance`` says whether random behaviours are drawn anew for each repeat or once. With a
    ``map_file`` the map is that file's, else it is drawn as ``map`` says.
    """

    name: str
    where: Where
    about: str = ""
    floorplan: LayerReference | None = None
    objects: tuple[LayerReference, ...] = ()
    behaviours: tuple[LayerReference, ...] = ()
    mission: LayerReference | None = None
    robot: LayerReference | None = None
    suts: tuple[LayerReference, ...] = ()
    oracles: tuple[LayerReference, ...] = ()
    map: MapSettings = field(default_factory=MapSettings)
    map_file: LayerReference | None = None
    vary: PlanVariation | None = None
    chance: _Chance = "per repeat"
    limit: float = 0.0


def resolve_scenario(
    name: str, text: CampaignFile, document: YamlDocument, seen: tuple[str, ...] = ()
) -> ResolvedScenario:
    """Return a scenario with what it inherits; raises :class:`InputError`.

    ``seen`` are the scenarios that are like this one.
    """
    scenario, path = text.scenarios[name], ("scenarios", name)
    where = document.where(path)
    if scenario.like is None:
        base = _defaults(name, where, text, document)
    else:
        like_at = document.where((*path, "like"))
        # In the order in which people would follow it, to be read as a chain.
        if scenario.like in (*seen, name):
            chain = " -> ".join((*seen, name, scenario.like))
            raise InputError(Diagnostic(like_at, f"scenarios are like each other: {chain}"))
        if scenario.like not in text.scenarios:
            hint = did_you_mean(scenario.like, text.scenarios)
            raise InputError(Diagnostic(like_at, f'no scenario "{scenario.like}" here', hint))
        base = resolve_scenario(scenario.like, text, document, (*seen, name))
    # The seed of variants that names none is the campaign's, also where the slot is inherited.
    varied = _vary(scenario.vary, (*path, "vary"), text, document) or base.vary
    renamed = replace(base, name=name, where=where, vary=varied)
    return _overlay(renamed, scenario, document, path)


def _defaults(
    name: str, where: Where, text: CampaignFile, document: YamlDocument
) -> ResolvedScenario:
    robot = LayerReference(text.robot, {}, document.where(("robot",))) if text.robot else None
    suts = _references(text.matrix.sut if text.matrix else [], ("matrix", "sut"), document)
    return ResolvedScenario(
        name,
        where,
        robot=robot,
        suts=suts,
        map=text.map.settings(),
        map_file=_map_file(text.map, ("map", "file"), document),
        vary=_vary(text.vary, ("vary",), text, document),
        chance=text.chance,
        limit=text.limit,
    )


def _vary(
    written: _VaryText | None, path: tuple[str, ...], text: CampaignFile, document: YamlDocument
) -> PlanVariation | None:
    if written is None:
        return None
    where = document.where((*path, "floorplan"))
    seed = text.seed % 2**32 if written.seed is None else written.seed
    return PlanVariation(
        LayerReference(written.floorplan, {}, where), written.samples, written.cover, seed
    )


_LISTS: Final = {"sut": "suts"} | {key: key for key in ("objects", "behaviours", "oracles")}
"""Slots that hold several layers, by the key people write."""


def _overlay(
    base: ResolvedScenario, scenario: _ScenarioText, document: YamlDocument, path: tuple[str, ...]
) -> ResolvedScenario:
    changes: dict[str, Any] = {}
    if scenario.floorplan is not None:
        where = document.where((*path, "floorplan"))
        changes["floorplan"] = _reference(scenario.floorplan, where)
    for slot in ("mission", "robot"):
        value = getattr(scenario, slot)
        if value is not None:
            changes[slot] = LayerReference(value, {}, document.where((*path, slot)))
    # A list takes the place of the inherited one, the key with a plus adds to whichever holds:
    # merging lists in silence is what surprises people elsewhere.
    for key, slot in _LISTS.items():
        value = getattr(scenario, key)
        if value is not None:
            changes[slot] = _references(value, (*path, key), document)
    for slot in ("behaviours", "oracles"):
        more = getattr(scenario, f"more_{slot}") or []
        inherited = changes.get(slot, getattr(base, slot))
        changes[slot] = inherited + _references(more, (*path, f"{slot}+"), document)
    if scenario.map is not None:
        changes["map"] = scenario.map.settings()
        changes["map_file"] = _map_file(scenario.map, (*path, "map", "file"), document)
    for slot in ("limit", "chance", "about"):
        if getattr(scenario, slot):
            changes[slot] = getattr(scenario, slot)
    return replace(base, **changes)


def _map_file(
    written: _MapText, path: tuple[str, ...], document: YamlDocument
) -> LayerReference | None:
    return LayerReference(written.file, {}, document.where(path)) if written.file else None


def _references(
    values: list[str] | list[LayerName], path: tuple[str, ...], document: YamlDocument
) -> tuple[LayerReference, ...]:
    return tuple(
        _reference(value, document.where((*path, index))) for index, value in enumerate(values)
    )


def _reference(value: LayerName, where: Where) -> LayerReference:
    if isinstance(value, str):
        return LayerReference(value, {}, where)
    if len(value) != 1:
        hint = "write one list item per layer"
        raise InputError(Diagnostic(where, "expected one layer with its overrides", hint))
    ((name, overrides),) = value.items()
    return LayerReference(name, overrides, where)


_REQUIRED: Final = {
    "floorplan": "floorplan",
    "mission": "mission",
    "robot": "robot",
    "suts": "sut",
    "oracles": "oracles",
}
"""Slots a scenario needs, each with the key people write."""


def missing_slots(scenario: ResolvedScenario) -> list[Diagnostic]:
    """Return an error for every slot that a scenario needs and nobody fills."""
    return [
        Diagnostic(scenario.where, f'scenario "{scenario.name}" names no {key}')
        for slot, key in _REQUIRED.items()
        if not getattr(scenario, slot) and not (slot == "floorplan" and scenario.vary)
    ]
