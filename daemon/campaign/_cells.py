"""A campaign while it is loaded, and its cells: scenarios in a world, with all their layers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from daemon.campaign._file import CampaignFile
from daemon.campaign._layers import LayerLibrary
from daemon.campaign._scenarios import ResolvedScenario
from daemon.model.spec import MapSettings, SutReference
from grammars.floorplan import FloorPlan
from grammars.model.behaviour import Behaviour
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from grammars.oracle import Oracle
from grammars.scenery import SceneryLayer
from grammars.text.diagnostics import Where
from grammars.text.documents import YamlDocument


@dataclass(frozen=True, slots=True)
class CampaignCell:
    """One scenario in one world, with all its layers loaded.

    ``name`` is the scenario's, with ``@<seed>`` for a variant of its plan. ``behaviours`` are those
    of each repeat, including the reserve. ``places`` are the places in files of waypoints, objects
    and the sentences about joints. The scene is composed of ``plan`` and ``layers``, with the
    campaign's overrides, objects before behaviours. ``given_map`` is the map file of the campaign,
    if it has one.
    """

    name: str
    scenario: ResolvedScenario
    plan: FloorPlan
    layers: tuple[SceneryLayer, ...]
    scene: Scene
    mission: Mission
    mission_where: Where
    places: Mapping[str, Where]
    robot: Robot
    suts: tuple[SutReference, ...]
    oracles: tuple[Oracle, ...]
    behaviours: tuple[tuple[Behaviour, ...], ...]
    map: MapSettings
    limit: float
    limit_where: Where
    given_map: OccupancyGrid | None = None


@dataclass(frozen=True, slots=True)
class Draft:
    """A campaign while it is loaded: each stage adds what the next ones need.

    ``scenarios`` are the concrete ones by name, ``oracles`` those of the campaign's files.
    """

    text: CampaignFile
    document: YamlDocument
    library: LayerLibrary
    scenarios: Mapping[str, ResolvedScenario]
    oracles: Mapping[str, Oracle] = field(default_factory=dict)
    cells: tuple[CampaignCell, ...] = ()
