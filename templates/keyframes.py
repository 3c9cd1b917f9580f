"""Key frames of joints as JSON, as the plugins that move doors at given times read them."""

from __future__ import annotations

import json
from pathlib import Path

from grammars.behaviour import Behaviour, Jump, KeyFrame, KeyFrames
from grammars.scene import Scene, SceneObject
from templates.naming import file_name
from templates.world import Draw, Job, driven, start_positions

ERA = "era"
"""Folder of the files as the plugins of 2024 read them: ``pose`` instead of ``position``."""


def said(scene: Scene, behaviours: tuple[Behaviour, ...]) -> dict[str, Behaviour]:
    """Return what every joint that can move does, by scene-wide name in scene order.

    A free joint that starts away from zero is set there by one key frame at time 0: simulators
    start all joints at zero. So is one that waits for an event, which no simulator knows of.
    Joints of frozen objects, and free ones at zero, are left out.
    """
    given = {behaviour.joint: behaviour for behaviour in behaviours}
    start = start_positions(scene, behaviours)
    found: dict[str, Behaviour] = {}
    for thing in scene.objects:
        moving = () if thing.frozen else driven(thing)
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
    frames = tuple(sorted(behaviour.frames, key=lambda frame: frame.time))
    if not frames or frames[0].time > 0.0:
        frames = (KeyFrame(0.0, initial), *frames)
    return KeyFrames(behaviour.joint, frames, behaviour.motion)


def frames_file(thing: SceneObject, joint: str, draw: Draw, *, era: bool = False) -> str:
    """Return the file of a joint's key frames, relative to the folder of the world."""
    single = len(thing.joints) == 1
    stem = file_name(thing.name) if single else f"{file_name(thing.name)}.{file_name(joint)}"
    folders = ["keyframes", *([ERA] if era else []), *([draw.name] if draw.name else [])]
    return "/".join((*folders, f"{stem}.json"))


def write_keyframes(job: Job) -> tuple[Path, ...]:
    """Write the key frames of every joint that has some, in both forms."""
    scene, written = job.world.scene, []
    for draw in job.world.draws:
        acts = said(scene, draw.behaviours)
        for thing in scene.objects:
            for joint in thing.joints:
                act = acts.get(f"{thing.name}.{joint.name}")
                if isinstance(act, KeyFrames):
                    for era, key in ((False, "position"), (True, "pose")):
                        path = job.path(*frames_file(thing, joint.name, draw, era=era).split("/"))
                        written.append(job.write(path, frames_text(act, key)))
    return tuple(written)


def frames_text(act: KeyFrames, key: str) -> str:
    """Return the key frames as JSON, one per line, sorted by time [s]."""
    lines = ",\n".join(
        f"  {json.dumps({key: frame.position, 'time': frame.time})}" for frame in act.frames
    )
    return f'{{"keyframes": [\n{lines}\n]}}\n'
