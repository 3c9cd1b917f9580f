"""The keys of a campaign file, as people write them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, Literal, TypeAlias

from pydantic import (
    ConfigDict,
    Field,
    model_validator,
)

from daemon.campaign._names import LayerName, Names, OneName, References
from daemon.campaign._results_file import (
    ONCE,
    AllowText,
    ExpectText,
    GateText,
    ReferenceText,
    RepeatsText,
)
from daemon.campaign._search_file import SearchText
from daemon.model.search import SEARCH_NAME
from daemon.model.spec import MapSettings
from grammars.model.grid import MapRule
from grammars.model.misplaced_keys import MISSION_KEYS, ROBOT_KEYS
from grammars.text.documents import OtherName, StrictModel
from grammars.text.quantity import Duration, Length

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


class SlotsText(StrictModel):
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
    """A mission: NAME.mission.yaml here or in missions/. NAME: {key: value} gives keys of the
    file other values, such as courier: {start.y: 0.1 m}."""
    without: Names | None = Field(default=None, examples=[["kitchen_door", "waypoint 3"]])
    """Parts to leave out of the composed world: an object by its name, waypoint NAME or waypoint 3,
    behaviour of NAME."""
    robot: LayerName | None = Field(default=None, examples=["courier"])
    """Another robot than the campaign's. NAME: {key: value} gives keys of the file other values,
    such as courier: {laser.noise: 2 cm}."""
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
    """Runs of every scenario, a number or {n: 5, pass: rate >= 80 %}; the same repeat has the
    same noise in each of them. By default 1, and 5 with a system that is not repeatable."""
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
    """Comparisons of scenarios by name, paired by repeat: delay(S3.2 vs S3.5) <= 30 s, with
    "on leg NAME" inside for one leg only; the name of a measure instead of delay compares that."""
    expect: list[ExpectText] = Field(default_factory=list)
    """Expected verdicts other than pass, and why; everything else must pass."""
    allow: list[AllowText] = Field(default_factory=list)
    """Warnings of the check that are intended, and why; errors cannot be allowed."""
    reference: dict[Annotated[str, Field(pattern=_NAME)], ReferenceText] = Field(
        default_factory=dict
    )
    """Published values of the same quantities, by a short name such as paper: marks in the figures
    of the report and a column in its tables. They change no verdict."""
    gate: GateText | None = None
    """Results that must not get worse than those of another campaign."""
