"""The campaign file as written: scenarios, what they inherit, what they name.

Every value names a layer file; a scenario that is ``like`` another is that scenario except for
the slots written here. ``oracles`` and ``behaviours`` replace the inherited list, ``oracles+`` and
``behaviours+`` add to it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from daemon.campaign.results import ONCE, ExpectText, GateText, RepeatsText
from daemon.spec import MapSettings
from grammars.diagnostics import Diagnostic, InputError, Where, did_you_mean
from grammars.documents import Document, Duration, Length, Written, read_model

_CAMPAIGN_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,59}$"
_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$"
Overrides: TypeAlias = dict[str, Any]
_OneLayer: TypeAlias = Annotated[
    dict[str, Overrides], Field(json_schema_extra={"minProperties": 1, "maxProperties": 1})
]
Named: TypeAlias = str | _OneLayer


def _as_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


_Names: TypeAlias = Annotated[
    list[str], BeforeValidator(_as_list, json_schema_input_type=str | list[str])
]
_References: TypeAlias = Annotated[
    list[Named], BeforeValidator(_as_list, json_schema_input_type=Named | list[Named])
]


class _MapText(Written):
    """The map handed to the system under test."""

    resolution: Length = Field(default=0.05, ge=0.01, le=0.5)
    """Edge of a cell."""
    doors: Literal["none", "initial"] = "none"
    """none: without objects, as a surveyor would draw it; initial: as they stand at the start."""


_Chance: TypeAlias = Literal["per repeat", "per campaign"]


class _VaryText(Written):
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


class _ScenarioText(Written):
    """One scenario: the layers that make it."""

    about: str = ""
    """One line for people."""
    like: str | None = None
    """Another scenario of this file: this one is the same except for what is written here."""
    abstract: bool = False
    """Never run itself, only for others to be like."""
    floorplan: str | None = None
    """A floor plan: NAME.fpm beside this file or in floorplans/."""
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


class _MatrixText(Written):
    """What every scenario is run with, in turn."""

    sut: _Names
    """Systems under test: NAME.yaml here or in suts/, or the name of a kind."""


class CampaignText(Written):
    """The keys of a campaign file."""

    campaign: str = Field(pattern=_CAMPAIGN_NAME)
    """Name of the campaign."""
    about: str = ""
    """One line for people."""
    seed: int = Field(default=0, ge=0, lt=2**63)
    """The only source of chance: the same seed gives the same runs, byte for byte."""
    repeats: RepeatsText = ONCE
    """Runs of every scenario, a number or {n: 5, pass: rate >= 80 %}; the same repeat sees the
    same noise in each of them."""
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
    gate: GateText | None = None
    """Results that must not get worse than those of another campaign."""


@dataclass(frozen=True, slots=True)
class Reference:
    """A layer by name, with the overrides written beside it and where it stands."""

    name: str
    overrides: Overrides
    where: Where


@dataclass(frozen=True, slots=True)
class Vary:
    """Run the scenario in variants of its floor plan: ``floorplan`` names a variation layer."""

    floorplan: Reference
    samples: int | None
    cover: Literal["random", "grid", "halton", "lhs", "pairwise"]
    seed: int


@dataclass(frozen=True, slots=True)
class ScenarioText:
    """A scenario after inheritance: every slot filled, nothing loaded yet.

    ``chance`` says whether random behaviours are drawn anew for each repeat or once.
    """

    name: str
    where: Where
    about: str = ""
    floorplan: Reference | None = None
    objects: tuple[Reference, ...] = ()
    behaviours: tuple[Reference, ...] = ()
    mission: Reference | None = None
    robot: Reference | None = None
    suts: tuple[Reference, ...] = ()
    oracles: tuple[Reference, ...] = ()
    map: MapSettings = field(default_factory=MapSettings)
    vary: Vary | None = None
    chance: _Chance = "per repeat"
    limit: float = 0.0


def read_campaign(document: Document) -> tuple[CampaignText, tuple[ScenarioText, ...]]:
    """Return the file's keys and its concrete scenarios; raises :class:`InputError`."""
    text = read_model(document, CampaignText)
    problems: list[Diagnostic] = []
    scenarios = []
    for name, scenario in text.scenarios.items():
        try:
            resolved = _resolve(name, text, document, ())
        except InputError as error:
            problems.extend(error.diagnostics)
            continue
        if not scenario.abstract:
            problems.extend(_missing(resolved))
            scenarios.append(resolved)
    if problems:
        raise InputError(dict.fromkeys(problems))
    if not scenarios:
        raise InputError(
            Diagnostic(document.where(("scenarios",)), "every scenario is abstract, nothing to run")
        )
    return text, tuple(scenarios)


def _resolve(
    name: str, text: CampaignText, document: Document, seen: tuple[str, ...]
) -> ScenarioText:
    scenario, path = text.scenarios[name], ("scenarios", name)
    where = document.where(path)
    if scenario.like is None:
        base = _defaults(name, where, text, document)
    else:
        like_at = document.where((*path, "like"))
        if scenario.like in (*seen, name):
            chain = " -> ".join((*seen, name, scenario.like))
            raise InputError(Diagnostic(like_at, f"scenarios are like each other: {chain}"))
        if scenario.like not in text.scenarios:
            hint = did_you_mean(scenario.like, text.scenarios)
            raise InputError(Diagnostic(like_at, f'no scenario "{scenario.like}" here', hint))
        base = _resolve(scenario.like, text, document, (*seen, name))
    varied = _vary(scenario.vary, (*path, "vary"), text, document) or base.vary
    renamed = replace(base, name=name, where=where, vary=varied)
    return _overlay(renamed, scenario, document, path)


def _defaults(name: str, where: Where, text: CampaignText, document: Document) -> ScenarioText:
    robot = Reference(text.robot, {}, document.where(("robot",))) if text.robot else None
    suts = _list(text.matrix.sut if text.matrix else None, ("matrix", "sut"), document)
    settings = MapSettings(text.map.resolution, text.map.doors)
    return ScenarioText(
        name,
        where,
        robot=robot,
        suts=suts or (),
        map=settings,
        vary=_vary(text.vary, ("vary",), text, document),
        chance=text.chance,
        limit=text.limit,
    )


def _vary(
    written: _VaryText | None, path: tuple[str, ...], text: CampaignText, document: Document
) -> Vary | None:
    if written is None:
        return None
    where = document.where((*path, "floorplan"))
    seed = text.seed % 2**32 if written.seed is None else written.seed
    return Vary(Reference(written.floorplan, {}, where), written.samples, written.cover, seed)


def _overlay(
    base: ScenarioText, scenario: _ScenarioText, document: Document, path: tuple[str, ...]
) -> ScenarioText:
    changes: dict[str, Any] = {}
    for slot in ("floorplan", "mission", "robot"):
        value = getattr(scenario, slot)
        if value is not None:
            changes[slot] = Reference(value, {}, document.where((*path, slot)))
    for key, slot in (("objects", "objects"), ("behaviours", "behaviours"), ("sut", "suts"),
                      ("oracles", "oracles")):  # fmt: skip
        found = _list(getattr(scenario, key), (*path, key), document)
        if found is not None:
            changes[slot] = found
    for slot in ("behaviours", "oracles"):
        more = _list(getattr(scenario, f"more_{slot}"), (*path, f"{slot}+"), document)
        changes[slot] = changes.get(slot, getattr(base, slot)) + (more or ())
    if scenario.map is not None:
        changes["map"] = MapSettings(scenario.map.resolution, scenario.map.doors)
    for slot in ("limit", "chance", "about"):
        if getattr(scenario, slot):
            changes[slot] = getattr(scenario, slot)
    return replace(base, **changes)


def _list(
    values: list[str] | list[Named] | None, path: tuple[str, ...], document: Document
) -> tuple[Reference, ...] | None:
    if values is None:
        return None
    references = []
    for index, value in enumerate(values):
        where = document.where((*path, index))
        if isinstance(value, str):
            references.append(Reference(value, {}, where))
            continue
        if len(value) != 1:
            raise InputError(
                Diagnostic(
                    where, "expected one layer with its overrides", "write one list item per layer"
                )
            )
        ((name, overrides),) = value.items()
        references.append(Reference(name, overrides, where))
    return tuple(references)


_REQUIRED: Final = {
    "floorplan": "floorplan",
    "mission": "mission",
    "robot": "robot",
    "suts": "sut",
    "oracles": "oracles",
}
"""Slots a scenario needs, each with the key people write."""


def _missing(scenario: ScenarioText) -> list[Diagnostic]:
    return [
        Diagnostic(scenario.where, f'scenario "{scenario.name}" names no {key}')
        for slot, key in _REQUIRED.items()
        if not getattr(scenario, slot) and not (slot == "floorplan" and scenario.vary)
    ]
