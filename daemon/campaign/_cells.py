"""What a scenario comes to: worlds, and cells in which a robot is sent through them."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from daemon.campaign._scenarios import ResolvedScenario
from daemon.model.spec import MapSettings, SutReference
from grammars.floorplan import FloorPlan
from grammars.model.behaviour import Behaviour, JointActs, Reaction, Walk
from grammars.model.grid import OccupancyGrid
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from grammars.oracle import Oracle
from grammars.preflight import places_of
from grammars.scenery import SceneryLayer
from grammars.scenery.composition import (
    ResolvedBehaviours,
    compile_scene,
    compile_sound_part,
    with_stand_ins,
)
from grammars.text.diagnostics import Diagnostic, InputError, Where
from grammars.text.documents import YamlDocument


@dataclass(frozen=True, slots=True)
class LoadedWorld:
    """The part of a cell that needs neither robot nor mission.

    Where something of it cannot be used it is not ``whole``, and no run is made of it: there are no
    ``layers`` where objects are missing, and no ``resolved`` behaviours.
    """

    name: str
    plan: FloorPlan
    layers: tuple[SceneryLayer, ...]
    scene: Scene
    resolved: tuple[ResolvedBehaviours, ...]
    places: Mapping[str, Where]
    whole: bool = True
    named: Scene | None = None
    """Has all that oracles may name; ``None`` where that is not known."""


def repeated_layers(
    scenario: ResolvedScenario, layers: Sequence[SceneryLayer | None]
) -> dict[int, Diagnostic]:
    """Return what to say of layers with objects that are named again, by their number.

    ``layers`` are those of the objects, then those of the behaviours.
    """
    references = (*scenario.objects, *scenario.behaviours)
    first: dict[str, int] = {}
    found = {}
    for number, layer in enumerate(layers):
        if layer is None or first.setdefault(layer.file, number) == number:
            continue
        # One that only says what objects do may be named again, to win over those in between.
        if not layer.models and not layer.instances:
            continue
        name, count = references[number].name, len(scenario.objects)
        places = "twice"
        if first[layer.file] < count <= number:
            places = "under objects and behaviours"
        message = f"{name} is named {places}"
        hint = "name it once, under objects: what it says of them holds as well"
        found[number] = Diagnostic(references[number].where, message, hint)
    return found


def sound_part(
    name: str, plan: FloorPlan, objects: tuple[SceneryLayer, ...], *, known: bool
) -> LoadedWorld:
    """Return what can be said of a world without the layers and objects that cannot be used."""
    named = None
    # What is wrong has been reported; without known names there is the building alone.
    scene = compile_scene(plan)
    with contextlib.suppress(InputError):
        scene, _ = compile_sound_part(plan, objects)
        named = with_stand_ins(scene, objects) if known else None
    return LoadedWorld(name, plan, (), scene, (), places_of(objects, plan), False, named)


def waypoint_places(mission: Mission, document: YamlDocument) -> dict[str, Where]:
    """Return where the start and the waypoints of a mission are written, by name."""
    places = {w.id: document.where(("waypoints", i)) for i, w in enumerate(mission.waypoints)}
    return places | {"start": document.where(("start",))}


def placed_alone(
    resolved: Sequence[ResolvedBehaviours], scene: Scene
) -> tuple[ResolvedBehaviours, ...]:
    """Return the behaviours of the objects in ``scene``, without those that wait for others.

    Whom they wait for may be an object that could not be placed.
    """
    names = {body.name for body in scene.objects}

    def kept(told: Behaviour) -> Behaviour | None:
        name = told.object if isinstance(told, Walk) else told.joint.partition(".")[0]
        if name not in names:
            return None
        if isinstance(told, Reaction | Walk) and isinstance(told.event, JointActs):
            return replace(told, event=None) if isinstance(told, Walk) else None
        return told

    return tuple(
        replace(one, behaviours=tuple(b for b in map(kept, one.behaviours) if b is not None))
        for one in resolved
    )


@dataclass(frozen=True, slots=True)
class CampaignCell:
    """One scenario in one world, with everything it names loaded.

    ``name`` is the scenario's, with ``@<seed>`` for a variant of its plan. ``behaviours`` holds
    those of each repeat, also of repeats that only come when a cell is not decided; ``places``
    says where waypoints, objects and the sentences about joints were written. ``plan`` and
    ``layers`` are what the scene was composed of, with the campaign's overrides, objects before
    behaviours. ``given_map`` is a map of one's own, where the campaign names one.
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
