"""Gazebo worlds, models and key frames: for gz-sim and ROS 2, and for Gazebo Classic and ROS 1.

Both kinds of world share the models. The plugins of the floor plan tools
(secorolab/floorplan-gazebo-plugins) move the doors, in their present form and in that of 2024. Key
frames are separate JSON files. Notes report the parts of a behaviour that the plugins cannot
express.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
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
"""Folder of the files for the plugins of 2024, with ``pose`` instead of ``position``."""


def behaviour_by_joint(scene: Scene, behaviours: tuple[Behaviour, ...]) -> dict[str, Behaviour]:
    """Return the behaviours of movable joints, by scene-wide name in scene order.

    Simulators start all joints at zero. One key frame at time 0 therefore sets a free joint, or one
    that waits for an event, to another start. Simulators do not know events. Joints of frozen
    objects, and free joints at zero, are omitted.
    """
    by_joint = {behaviour.joint: behaviour for behaviour in behaviours}
    start = start_positions(scene, behaviours)
    acts: dict[str, Behaviour] = {}
    for thing in scene.objects:
        moving = () if thing.frozen else driven_joints(thing)
        for joint, initial in zip(thing.joints, thing.initial, strict=True):
            name = f"{thing.name}.{joint.name}"
            if joint not in moving:
                continue
            if name in by_joint and by_joint[name].kind in ("hold", "key-frames", "trigger"):
                acts[name] = _from_the_start(by_joint[name], initial)
            elif start[name] != 0.0:
                acts[name] = KeyFrames(name, (KeyFrame(0.0, start[name]),), Jump())
    return acts


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
    """Return the frames for the plugin of key frames, by scene-wide joint name in scene order.

    These are the key frames of the behaviours, and one frame for every joint of another plugin that
    does not start at zero: other plugins only pull it there. The holding plugin of 2024 needs no
    frame, since it sets the joint in the first step.
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
    """Return the path of a joint's key frames, relative to the folder of the world."""
    single = len(thing.joints) == 1
    stem = file_name(thing.name) if single else f"{file_name(thing.name)}.{file_name(joint)}"
    folders = ["keyframes", *([ERA] if era else []), *([draw.name] if draw.name else [])]
    return "/".join((*folders, f"{stem}.json"))


def write_keyframes(job: ExportJob) -> tuple[Path, ...]:
    """Write the key frames of every joint that has some, in both forms."""
    scene, files = job.world.scene, []
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
                        files.append(job.write(path, frames_text(act, key)))
    return tuple(files)


def frames_text(act: KeyFrames, key: str) -> str:
    """Return the key frames as JSON, one per line, in the order of playing, times in s."""
    lines = ",\n".join(
        f"  {json.dumps({key: frame.position, 'time': frame.time})}" for frame in act.frames
    )
    return f'{{"keyframes": [\n{lines}\n]}}\n'


_BANDWIDTH: Final = 20.0
"""Bandwidth of a position controller [rad/s]: critically damped, stable at steps of 3 ms."""
_GROUND: Final = "ground_plane"


def models_of(scene: Scene, reserved: set[str]) -> dict[str, tuple[str, Body]]:
    """Return, by object, the name and body of its model; equal bodies share one model.

    Models must not have ``reserved`` names.
    """
    names: dict[tuple[str, Body], str] = {}
    used = set(reserved)
    models: dict[str, tuple[str, Body]] = {}
    for thing in scene.objects:
        body = body_of(thing)
        # Mirrored and frozen objects are other bodies of the same model.
        key = (thing.model, body)
        if key not in names:
            name = file_name(thing.model + ("_mirrored" if thing.mirrored else ""))
            name += "_static" if thing.frozen and thing.joints else ""
            names[key] = _free(name, used)
        models[thing.name] = (names[key], body)
    return models


def world_file(job: ExportJob, draw: BehaviourDraw, *, classic: bool) -> str:
    """Return the path of a world's file, relative to the folder of the world."""
    stem = f"{job.name}-{draw.name}" if draw.name else job.name
    return f"gazebo/worlds/{stem}.{'world' if classic else 'sdf'}"


def write_sdf(job: ExportJob) -> tuple[Path, ...]:
    """Write the models and, for every draw of behaviours, a world for each Gazebo."""
    scene = job.world.scene
    models = models_of(scene, {job.building, _GROUND})
    files = _write_building(job)
    for name, body in dict(models.values()).items():
        files += [_render(job, f"gazebo/models/{name}/model.sdf", name=name, body=body)]
        about = f"{name}, an object of {scene.name}"
        files += [_render(job, f"gazebo/models/{name}/model.config", name=name, about=about)]
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
            files.append(job.write(path, text))
    job.notes.extend(dict.fromkeys(_losses(job)))
    return tuple(files)


def _write_building(job: ExportJob) -> list[Path]:
    from templates.mesh import stl_bytes, wall_mesh

    name = job.building
    folder = f"gazebo/models/{name}"
    files: list[Path] = []
    if job.world.scene.solids:
        stl = job.path(*folder.split("/"), "meshes", f"{name}.stl")
        stl.write_bytes(stl_bytes(wall_mesh(job.world.scene.solids)))
        files.append(stl)
    mesh = f"model://{name}/meshes/{name}.stl" if files else ""
    path = job.path(*folder.split("/"), "model.sdf")
    text = render("building_model.sdf.j2", name=name, mesh=mesh)
    about = f"walls and columns of {job.world.scene.name}"
    config = _render(job, f"{folder}/model.config", name=name, about=about)
    return [*files, job.write(path, text), config]


def _render(job: ExportJob, path: str, **values: Any) -> Path:
    template = "model.config.j2" if path.endswith(".config") else "object_model.sdf.j2"
    return job.write(job.path(*path.split("/")), render(template, **values))


def _instances(
    job: ExportJob, models: dict[str, tuple[str, Body]], draw: BehaviourDraw, classic: bool
) -> list[dict[str, Any]]:
    """Return the objects of a world: model, pose x, y, z, roll, pitch, yaw, and acts of joints."""
    acts = behaviour_by_joint(job.world.scene, draw.behaviours)
    played = played_frames(job.world.scene, draw.behaviours, era=classic)
    target = job.world.robot.name if job.world.robot else "robot"
    instances = []
    for thing in job.world.scene.objects:
        model, body = models[thing.name]
        pose = (thing.pose.x, thing.pose.y, 0.0, 0.0, 0.0, thing.pose.yaw)
        joint_acts = tuple(
            _act(thing, joint, acts[name])
            | {"uri": frames_file(thing, joint.of, draw, era=classic) if name in played else ""}
            | {"target": target}
            for joint in body.joints
            if (name := f"{thing.name}.{joint.of}") in acts
        )
        instance = {"name": thing.name, "model": model, "static": body.static}
        instances.append(instance | {"pose": pose, "acts": joint_acts})
    return instances


def _act(thing: SceneObject, joint: BodyJoint, act: Behaviour) -> dict[str, Any]:
    """Return the values for one joint in the template, by the tags of the plugins."""
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
    """Return gains of a position controller for a motion of the joint."""
    if isinstance(motion, Spring):
        # A spring has no limit of effort; 1000 is more than any door needs.
        return {"p": motion.stiffness, "d": motion.damping, "effort": 1000.0}
    effort = motion.effort if isinstance(motion, Servo) else 1000.0
    moment = joint.moment
    # p = I w^2 and d = 2 I w: critical damping for the moment of inertia of the joint's load.
    return {"p": moment * _BANDWIDTH**2, "d": 2.0 * moment * _BANDWIDTH, "effort": effort}


def _losses(job: ExportJob) -> Iterator[str]:
    """Yield notes about behaviours that the published plugins cannot execute."""
    for draw in job.world.draws:
        for behaviour in draw.behaviours:
            if behaviour.kind == "reaction":
                yield f"{behaviour.joint}: no plugin waits for events, it stays at its start"
            elif behaviour.kind == "walk":
                yield f"{behaviour.object}: no plugin walks, it stays at its start"
        for joint, act in behaviour_by_joint(job.world.scene, draw.behaviours).items():
            if isinstance(act, KeyFrames) and not isinstance(act.motion, Jump):
                yield f"{joint}: the plugin for key frames jumps, it has no {act.motion.kind}"
            if not isinstance(act, Trigger):
                continue
            if act.of not in ("hinge", "foot") or act.to != "base":
                yield (
                    f"{joint}: the trigger plugin measures from the foot of the object to the "
                    f"base of the robot, not from the {act.of} to its {act.to}"
                )
            if act.rearm is not None:
                yield f"{joint}: the trigger plugin fires once, it does not rearm"
            # Its PID has P 0.5, I 1, D 0. Gazebo Classic clamps the integral to its default limits
            # [0, 0], so the controller acts as a spring.
            if act.motion != Spring(0.5, 0.0):
                yield (
                    f"{joint}: the trigger plugin of 2024 pulls with a spring of 0.5 N m/rad, "
                    f"not with the {act.motion.kind} of the layer"
                )


def _free(name: str, used: set[str]) -> str:
    """Return and use ``name``, or the first unused one of ``name_2``, ``name_3``, …."""
    free = free_name(name, used, "_")
    used.add(free)
    return free
