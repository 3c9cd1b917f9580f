"""Composition of runs, for campaigns, searches and blame: plan, layers, values, repeat, omissions.

A :class:`ResolvedScenario` contains all of these: its layers, the values beside their names, and
``without``, the parts that are left out of the composed world. So another run of a cell is that
cell with another scenario::

    composer = Composer(LayerLibrary(folder), campaign.seed)
    scenario = with_overrides(cell.scenario, "behaviours", 0, {"near": 1.0})
    scenario = replace(scenario, without=(LayerReference("waypoint 3", {}, where),))
    changed = composer.cell(cell, scenario, repeat)
    spec = run_spec(campaign, changed, changed.suts[0], repeat, behaviours=changed.behaviours[0], …)

Parts are written as ``bedroom_door`` (an object), ``waypoint home`` or ``waypoint 3`` (by number
from 1), ``behaviour of bedroom_door`` or ``behaviour of bedroom_door.hinge``. They are removed
after all random draws, so the other parts move as before.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from daemon.campaign._campaign import repeat_seed
from daemon.campaign._layers import CampaignCell, LayerLibrary
from daemon.campaign._scenarios import ResolvedScenario, required
from daemon.model.spec import Script
from grammars.floorplan import FloorPlan
from grammars.model.behaviour import (
    Behaviour,
    Event,
    JointActs,
    LegBegins,
    Reaction,
    Walk,
    WaypointReached,
)
from grammars.model.free_space import inscribed_radius
from grammars.model.mission import Mission
from grammars.model.movers import is_mover
from grammars.model.robot import Robot
from grammars.model.scene import Scene
from grammars.oracle import Leg, leg_number
from grammars.scenery import SceneryLayer
from grammars.scenery.composition import ResolvedBehaviours, compile_scene, resolve_behaviours
from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean

_MOST_SCENES: Final = 64
"""Most scenes in the cache: those of repeats, and of values nearby."""


@dataclass(slots=True)
class Composer:
    """Composes the runs of one campaign with ``seed``; equal scenes are compiled once."""

    library: LayerLibrary
    seed: int
    _scenes: dict[tuple[FloorPlan, tuple[SceneryLayer, ...]], Scene] = field(default_factory=dict)

    def cell(self, base: CampaignCell, scenario: ResolvedScenario, repeat: int) -> CampaignCell:
        """Return ``base`` changed to ``scenario``, with the behaviours of one repeat alone.

        Layers that both scenarios name alike are those of ``base``. Raises :class:`InputError` for
        values that a layer or the geometry refuses, and for parts that cannot be left out.
        """
        library, previous = self.library, base.scenario
        # Warnings of the original scenario are reported already; those of thousands would pile up.
        library.warnings.clear()
        robot, suts, layers = base.robot, base.suts, base.layers
        if scenario.robot != previous.robot:
            robot = library.robot(required(scenario.robot))
        if scenario.suts != previous.suts:
            suts = tuple(map(library.sut, scenario.suts))
        references = (*scenario.objects, *scenario.behaviours)
        if references != (*previous.objects, *previous.behaviours):
            layers = tuple(map(library.configured_scenery, references))
        variant, plan = self._plan(base, scenario, robot)
        objects, scene = layers[: len(scenario.objects)], base.scene
        same = plan == base.plan and objects == base.layers[: len(previous.objects)]
        if previous.without or not same:
            scene = self.scene(plan, objects)
        while len(self._scenes) > _MOST_SCENES:
            del self._scenes[next(iter(self._scenes))]
        mission, _ = library.mission(required(scenario.mission))
        resolved = self.behaviours(scenario, scene, layers, [repeat])
        changed = replace(
            base,
            name=scenario.name + variant,
            scenario=scenario,
            plan=plan,
            layers=layers,
            scene=scene,
            mission=mission,
            robot=robot,
            suts=suts,
            behaviours=tuple(one.behaviours for one in resolved),
        )
        return leave_out(changed)

    def scene(self, plan: FloorPlan, objects: Sequence[SceneryLayer]) -> Scene:
        """Return the scene of a plan and object layers; equal ones are the same object."""
        # Cells with equal plan and objects share a scene with its digest, its file and its check.
        key = (plan, tuple(objects))
        if key not in self._scenes:
            self._scenes[key] = compile_scene(plan, objects)
        return self._scenes[key]

    def behaviours(
        self,
        scenario: ResolvedScenario,
        scene: Scene,
        layers: Sequence[SceneryLayer],
        repeats: Iterable[int],
    ) -> tuple[ResolvedBehaviours, ...]:
        """Return the concrete behaviours of each repeat, drawn for each or once for all."""
        # The paper keeps the random doors of its scenario S2 in all five repeats, as ``chance: per
        # campaign`` does; sensor noise differs in each repeat either way.
        draws = [repeat if scenario.chance == "per repeat" else 0 for repeat in repeats]
        resolved = {
            draw: resolve_behaviours(
                scene, layers, seed=repeat_seed(self.seed, draw), limit=scenario.limit
            )
            for draw in dict.fromkeys(draws)
        }
        return tuple(resolved[draw] for draw in draws)

    def _plan(
        self, base: CampaignCell, scenario: ResolvedScenario, robot: Robot
    ) -> tuple[str, FloorPlan]:
        """Return the plan, and the suffix of the cell's name after that of the scenario."""
        vary, previous = scenario.vary, base.scenario
        if vary is None:
            if scenario.floorplan == previous.floorplan:
                return "", base.plan
            return "", self.library.floorplan(required(scenario.floorplan))
        if vary == previous.vary and robot == base.robot:
            return base.name.removeprefix(previous.name), base.plan
        variants = self.library.variants(vary, inscribed_radius(robot.footprint))
        if len(variants) != 1:
            message = f"{scenario.name} is run in {len(variants)} buildings, a search takes one"
            raise InputError.at(vary.floorplan.where, message)
        ((name, plan),) = variants
        return f"@{name.rpartition('_')[2]}", plan


def leave_out(cell: CampaignCell) -> CampaignCell:
    """Return a cell without the parts that its scenario leaves out, as if there were none.

    Raises :class:`InputError` for missing parts, if no waypoint remains, and for behaviours that
    wait for a part that is left out: their run would be another one, not a smaller one.
    """
    if not cell.scenario.without:
        return cell
    parts = _find_parts(cell)
    scene, mission = cell.scene, cell.mission
    objects = tuple(body for body in scene.objects if body.name not in parts.objects)
    # Like the compiler: only scenes with movers keep the frames of their routes.
    frames = scene.frames if any(is_mover(body.joints) for body in objects) else ()
    waypoints = tuple(w for i, w in enumerate(mission.waypoints) if i not in parts.waypoints)
    if not waypoints:
        where = next(reversed(parts.waypoints.values()))
        hint = "keep one for the robot to drive to"
        raise InputError(Finding(where, "no waypoint of the mission is left", hint))
    # Many repeats share one script, and still do afterwards.
    scripts = {id(script): parts.script(script, mission) for script in cell.behaviours}
    return replace(
        cell,
        scene=replace(scene, objects=objects, frames=frames),
        mission=replace(mission, waypoints=waypoints),
        behaviours=tuple(scripts[id(script)] for script in cell.behaviours),
    )


@dataclass(frozen=True, slots=True)
class _LeftOutParts:
    """Parts that are left out, each with its place in the file.

    ``waypoints`` are numbered from 0, ``behaviours`` are joints and names of objects.
    """

    objects: dict[str, Where] = field(default_factory=dict)
    waypoints: dict[int, Where] = field(default_factory=dict)
    behaviours: dict[str, Where] = field(default_factory=dict)

    def script(self, script: Script, mission: Mission) -> Script:
        """Return the remaining behaviours, with legs numbered anew."""
        return tuple(
            self._adapted(behaviour, mission)
            for behaviour in script
            if _object_of(behaviour.joint) not in self.objects
            and self.behaviours.keys().isdisjoint(_subjects(behaviour))
        )

    def _adapted(self, behaviour: Behaviour, mission: Mission) -> Behaviour:
        if not isinstance(behaviour, Reaction | Walk) or behaviour.event is None:
            return behaviour
        event, causes = self._event(behaviour.event, mission)
        if event is None:
            name = behaviour.object if isinstance(behaviour, Walk) else behaviour.joint
            hint = f'leave "behaviour of {name}" out as well'
            raise InputError(Finding(causes[0], f"{name} waits for this part", hint))
        return replace(behaviour, event=event)

    def _event(self, event: Event, mission: Mission) -> tuple[Event | None, Sequence[Where]]:
        """Return the rest of an event, and the places that remove parts of it."""
        missing = self.waypoints
        match event:
            case LegBegins(leg=leg):
                if leg - 1 in missing:
                    return None, [missing[leg - 1]]
                return LegBegins(leg - sum(number < leg - 1 for number in missing)), ()
            case WaypointReached(waypoint=name):
                numbers = [i for i, w in enumerate(mission.waypoints) if w.id == name]
                causes = [missing[number] for number in numbers if number in missing]
                # The pre-flight reports a waypoint that no mission has.
                return None if causes and len(causes) == len(numbers) else event, causes
            case JointActs(joints=joints, act=act):
                rest = tuple(joint for joint in joints if _object_of(joint) not in self.objects)
                causes = [self.objects[_object_of(j)] for j in joints if j not in rest]
                return JointActs(rest, act) if rest else None, causes


_WAYPOINT: Final = re.compile(r"waypoint\s+(?P<name>\S.*)")
_BEHAVIOUR: Final = re.compile(r"behaviour\s+of\s+(?P<name>\S.*)")


def _find_parts(cell: CampaignCell) -> _LeftOutParts:
    """Find the parts that are left out; raises :class:`InputError` for all missing ones."""
    parts, problems = _LeftOutParts(), []
    objects = [body.name for body in cell.scene.objects]
    # Every repeat moves the same joints: only their motion is random.
    subjects = {name for b in cell.behaviours[0] for name in _subjects(b)}
    for part in cell.scenario.without:
        if waypoint := _WAYPOINT.fullmatch(part.name):
            try:
                number = int(waypoint["name"]) if waypoint["name"].isdecimal() else 0
                leg = leg_number(Leg(number, "" if number else waypoint["name"]), cell.mission)
            except ValueError as error:
                problems.append(Finding(part.where, str(error)))
                continue
            parts.waypoints[leg - 1] = part.where
        elif behaviour := _BEHAVIOUR.fullmatch(part.name):
            name = behaviour["name"]
            if name not in subjects:
                hint = did_you_mean(name, subjects)
                problems.append(Finding(part.where, f'"{name}" has no behaviour here', hint))
            parts.behaviours[name] = part.where
        else:
            if part.name not in objects:
                hint = _FORMS if " " in part.name else did_you_mean(part.name, objects)
                problems.append(Finding(part.where, f'no object "{part.name}" here', hint))
            parts.objects[part.name] = part.where
    if problems:
        raise InputError(problems)
    return parts


_FORMS: Final = 'write the name of an object, "waypoint NAME" or "behaviour of NAME"'


def _object_of(joint: str) -> str:
    return joint.partition(".")[0]


def _subjects(behaviour: Behaviour) -> tuple[str, str]:
    """Return the names of a behaviour for people: its joint, and its object."""
    return behaviour.joint, _object_of(behaviour.joint)
