"""Gazebo worlds, models and key frames: for gz-sim and ROS 2, and for Gazebo Classic and ROS 1.

Both kinds of world share the models. What doors do is said with the plugins of the floor plan
tools (secorolab/floorplan-gazebo-plugins) in their present form and in that of 2024, key frames in
JSON files of their own; where these cannot say all of a behaviour, a note tells what is lost.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from grammars.model.behaviour import (
    Behaviour,
    Hold,
    Jump,
    KeyFrame,
    KeyFrames,
    Servo,
    Spring,
    Trigger,
    start_positions,
)
from grammars.model.kinematics import driven_joints
from grammars.model.scene import Scene, SceneObject
from templates.bodies import Body, BodyJoint, body_of
from templates.naming import file_name, free_name
from templates.rendering import render
from templates.world import BehaviourDraw, ExportJob

ERA = "era"
"""Folder of the files as the plugins of 2024 read them: ``pose`` instead of ``position``."""


def behaviour_by_joint(scene: Scene, behaviours: tuple[Behaviour, ...]) -> dict[str, Behaviour]:
    """Return what every joint that can move does, by scene-wide name in scene order.

    A free joint that starts away from zero is set there by one key frame at time 0: simulators
    start all joints at zero. So is one that waits for an event, which no simulator knows of.
    Joints of frozen objects, and free ones at zero, are left out.
    """
    given = {behaviour.joint: behaviour for behaviour in behaviours}
    start = start_positions(scene, behaviours)
    found: dict[str, Behaviour] = {}
    for thing in scene.objects:
        moving = () if thing.frozen else driven_joints(thing)
        for joint, initial in zip(thing.joints, thing.initial, strict=True):
            name = f"{thing.name}.{joint.name}"
            if joint not in moving:
                continue
            if name in given and given[name].kind in ("hold", "key-frames", "trigger"):
                found[name] = _from_the_start(given[name], initial)
            elif start[name] != 0.0:
                found[name] = KeyFrames(name, (KeyFrame(0.0, start[name]),), Jump())
    return found


def _from_the_start(behaviour: Behaviour, initial: float) -> Behaviour:
    if not isinstance(behaviour, KeyFrames):
        return behaviour
    frames = behaviour.frames
    if not frames or frames[0].time > 0.0:
        frames = (KeyFrame(0.0, initial), *frames)
    return KeyFrames(behaviour.joint, frames, behaviour.motion)


def played_frames(
    scene: Scene, behaviours: tuple[Behaviour, ...], *, era: bool = False
) -> dict[str, KeyFrames]:
    """Return what the plugin for key frames plays, by scene-wide joint name in scene order.

    These are the key frames of the behaviours, and one frame for every joint that something else
    moves but that does not start at zero: the other plugins only pull it there. The one of 2024
    that holds a joint needs none, it puts the joint there in the first step.
    """
    acts, start = behaviour_by_joint(scene, behaviours), start_positions(scene, behaviours)
    played: dict[str, KeyFrames] = {}
    for joint, act in acts.items():
        if isinstance(act, KeyFrames):
            played[joint] = act
        elif start[joint] != 0.0 and not (era and isinstance(act, Hold)):
            played[joint] = KeyFrames(joint, (KeyFrame(0.0, start[joint]),), Jump())
    return played


def frames_file(thing: SceneObject, joint: str, draw: BehaviourDraw, *, era: bool = False) -> str:
    """Return the file of a joint's key frames, relative to the folder of the world."""
    single = len(thing.joints) == 1
    stem = file_name(thing.name) if single else f"{file_name(thing.name)}.{file_name(joint)}"
    folders = ["keyframes", *([ERA] if era else []), *([draw.name] if draw.name else [])]
    return "/".join((*folders, f"{stem}.json"))


def write_keyframes(job: ExportJob) -> tuple[Path, ...]:
    """Write the key frames of every joint that has some, in both forms."""
    scene, written = job.world.scene, []
    for draw in job.world.draws:
        # The plugins renamed the key in June 2025; with the wrong one every position reads as 0.
        forms = [
            (era, key, played_frames(scene, draw.behaviours, era=era))
            for era, key in ((False, "position"), (True, "pose"))
        ]
        for thing in scene.objects:
            for joint in thing.joints:
                for era, key, played in forms:
                    act = played.get(f"{thing.name}.{joint.name}")
                    if act is not None:
                        path = job.path(*frames_file(thing, joint.name, draw, era=era).split("/"))
                        written.append(job.write(path, frames_text(act, key)))
    return tuple(written)


def frames_text(act: KeyFrames, key: str) -> str:
    """Return the key frames as JSON, one per line, in the order they are played in, times in s."""
    lines = ",\n".join(
        f"  {json.dumps({key: frame.position, 'time': frame.time})}" for frame in act.frames
    )
    return f'{{"keyframes": [\n{lines}\n]}}\n'


_BANDWIDTH: Final = 20.0
"""How fast a position controller follows [rad/s]: critically damped, stable at steps of 3 ms."""
_GROUND: Final = "ground_plane"


@dataclass(frozen=True, slots=True)
class PlacedModel:
    """An object in a world: its model, its pose x, y, z, roll, pitch, yaw, what its joints do."""

    name: str
    model: str
    static: bool
    pose: tuple[float, ...]
    acts: tuple[dict[str, Any], ...]


def models_of(scene: Scene, taken: set[str]) -> dict[str, tuple[str, Body]]:
    """Return for every object its model's name and body; equal bodies share one model.

    ``taken`` are names models must not have.
    """
    names: dict[tuple[str, Body], str] = {}
    used = set(taken)
    found: dict[str, tuple[str, Body]] = {}
    for thing in scene.objects:
        body = body_of(thing)
        # Mirrored and frozen objects are other bodies of the same model.
        key = (thing.model, body)
        if key not in names:
            wanted = file_name(thing.model + ("_mirrored" if thing.mirrored else ""))
            wanted += "_static" if thing.frozen and thing.joints else ""
            names[key] = _free(wanted, used)
        found[thing.name] = (names[key], body)
    return found


def world_file(job: ExportJob, draw: BehaviourDraw, *, classic: bool) -> str:
    """Return a world's file, relative to the folder of the world."""
    stem = f"{job.name}-{draw.name}" if draw.name else job.name
    return f"gazebo/worlds/{stem}.{'world' if classic else 'sdf'}"


def write_sdf(job: ExportJob) -> tuple[Path, ...]:
    """Write the models and, for every draw of behaviours, a world for each Gazebo."""
    scene = job.world.scene
    models = models_of(scene, {job.building, _GROUND})
    written = _write_building(job)
    for name, body in dict(models.values()).items():
        written += [_render(job, f"gazebo/models/{name}/model.sdf", name=name, body=body)]
        about = f"{name}, an object of {scene.name}"
        written += [_render(job, f"gazebo/models/{name}/model.config", name=name, about=about)]
    for draw in job.world.draws:
        for classic in (False, True):
            path = job.path(*world_file(job, draw, classic=classic).split("/"))
            text = render(
                "gazebo_classic.world.j2" if classic else "gazebo.sdf.j2",
                name=path.stem,
                building=job.building,
                building_instance=_free(job.building, {o.name for o in scene.objects}),
                ground=_free(_GROUND, {job.building, *(o.name for o in scene.objects)}),
                instances=_instances(job, models, draw, classic),
            )
            written.append(job.write(path, text))
    job.notes.extend(dict.fromkeys(_losses(job)))
    return tuple(written)


def _write_building(job: ExportJob) -> list[Path]:
    from templates.mesh import stl_bytes, wall_mesh

    name = job.building
    folder = f"gazebo/models/{name}"
    written: list[Path] = []
    if job.world.scene.solids:
        stl = job.path(*folder.split("/"), "meshes", f"{name}.stl")
        stl.write_bytes(stl_bytes(wall_mesh(job.world.scene.solids)))
        written.append(stl)
    mesh = f"model://{name}/meshes/{name}.stl" if written else ""
    path = job.path(*folder.split("/"), "model.sdf")
    text = render("building_model.sdf.j2", name=name, mesh=mesh)
    about = f"walls and columns of {job.world.scene.name}"
    config = _render(job, f"{folder}/model.config", name=name, about=about)
    return [*written, job.write(path, text), config]


def _render(job: ExportJob, path: str, **values: Any) -> Path:
    template = "model.config.j2" if path.endswith(".config") else "object_model.sdf.j2"
    return job.write(job.path(*path.split("/")), render(template, **values))


def _instances(
    job: ExportJob, models: dict[str, tuple[str, Body]], draw: BehaviourDraw, classic: bool
) -> list[PlacedModel]:
    acts = behaviour_by_joint(job.world.scene, draw.behaviours)
    played = played_frames(job.world.scene, draw.behaviours, era=classic)
    target = job.world.robot.name if job.world.robot else "robot"
    found = []
    for thing in job.world.scene.objects:
        model, body = models[thing.name]
        pose = (thing.pose.x, thing.pose.y, 0.0, 0.0, 0.0, thing.pose.yaw)
        described = tuple(
            _act(thing, joint, acts[name])
            | {"uri": frames_file(thing, joint.of, draw, era=classic) if name in played else ""}
            | {"target": target}
            for joint in body.joints
            if (name := f"{thing.name}.{joint.of}") in acts
        )
        found.append(PlacedModel(thing.name, model, body.static, pose, described))
    return found


def _act(thing: SceneObject, joint: BodyJoint, act: Behaviour) -> dict[str, Any]:
    """Return what a template needs to say about one joint, by the tags of the plugins."""
    several = len(thing.joints) > 1
    values: dict[str, Any] = {
        "kind": act.kind,
        "joint": joint.name,
        "suffix": f"_{joint.name}" if several else "",
        "topic": f"{thing.name}_{joint.name}_controller" if several else f"{thing.name}_controller",
    }
    match act:
        case Hold():
            values |= {"position": act.position} | _gains(joint, Servo())
        case Trigger():
            values |= {"start": act.start, "end": act.end, "distance": act.distance}
            values |= _gains(joint, act.motion)
    return values


def _gains(joint: BodyJoint, motion: Servo | Spring | Jump) -> dict[str, float]:
    """Return gains of a position controller that moves the joint as the motion says."""
    if isinstance(motion, Spring):
        # A spring pulls as hard as it takes; 1000 is no limit for a door.
        return {"p": motion.stiffness, "d": motion.damping, "effort": 1000.0}
    effort = motion.effort if isinstance(motion, Servo) else 1000.0
    moment = joint.moment
    # p = I w^2 and d = 2 I w: critically damped for the moment of inertia the joint moves.
    return {"p": moment * _BANDWIDTH**2, "d": 2.0 * moment * _BANDWIDTH, "effort": effort}


def _losses(job: ExportJob) -> Iterator[str]:
    """Say what the published plugins cannot do."""
    for draw in job.world.draws:
        for behaviour in draw.behaviours:
            if behaviour.kind == "reaction":
                yield f"{behaviour.joint}: no plugin waits for events, it stays where it starts"
            elif behaviour.kind == "walk":
                yield f"{behaviour.object}: no plugin walks, it stands where it starts"
        for joint, act in behaviour_by_joint(job.world.scene, draw.behaviours).items():
            if isinstance(act, KeyFrames) and not isinstance(act.motion, Jump):
                yield f"{joint}: the plugin for key frames jumps, it knows no {act.motion.kind}"
            if not isinstance(act, Trigger):
                continue
            if act.of not in ("hinge", "foot") or act.to != "base":
                yield (
                    f"{joint}: the trigger plugin measures from the foot of the object to the "
                    f"base of the robot, not from the {act.of} to its {act.to}"
                )
            if act.rearm is not None:
                yield f"{joint}: the trigger plugin fires once, it does not rearm"
            # Its PID has P 0.5, I 1, D 0 with the default limits [0, 0] of the integral, which
            # Gazebo Classic clamps to zero: what is left is a spring.
            if act.motion != Spring(0.5, 0.0):
                yield (
                    f"{joint}: the trigger plugin of 2024 pulls with a spring of 0.5 N m/rad, "
                    f"whatever the {act.motion.kind} of the layer says"
                )


def _free(name: str, taken: set[str]) -> str:
    """Return ``name``, or the first of ``name_2``, ``name_3``, … that is not taken; take it."""
    free = free_name(name, taken, "_")
    taken.add(free)
    return free
