"""Where behaviours put joints at the start, and what contradicts itself among them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

from daemon.simulator._behaviours import frame_tick
from grammars.behaviour import Behaviour, Hold, Jump, KeyFrames, Reaction, Trigger, Walk
from grammars.movers import JOINTS, chain_positions, is_mover
from grammars.route import Route
from grammars.scene import Scene, SceneObject
from grammars.values import Pose2


def starting_positions(
    scene: Scene, behaviours: Sequence[Behaviour]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return where behaviours put joints at the start, and which joints they hold for good.

    Raises:
        ValueError: a behaviour names no joint of the scene, one of a frozen object, or one that
            another behaviour drives, or of a mover; walks of what is no mover or without a
            way; key frames out of order or before 0; a trigger whose
            ``rearm`` is not greater than its ``distance``.
    """
    frozen = {f"{o.name}.{j.name}": o.frozen for o in scene.objects for j in o.joints}
    movers = {o.name: o for o in scene.objects if is_mover(o.joints)}
    start: dict[str, float] = {}
    held = {
        f"{o.name}.{joint}": q
        for o in movers.values()
        for joint, q in zip(JOINTS, o.initial, strict=False)
    }
    seen: set[str] = set()
    for behaviour in behaviours:
        name = behaviour.joint
        if isinstance(behaviour, Walk):
            _check_walk(behaviour, movers)
        if name not in frozen:
            raise ValueError(f"behaviour {behaviour.kind}: the scene has no joint {name!r}")
        if frozen[name]:
            raise ValueError(f"behaviour {behaviour.kind}: joint {name!r} is frozen")
        if name in seen:
            raise ValueError(f"joint {name!r} has more than one behaviour")
        seen.add(name)
        if isinstance(behaviour, Walk):
            start.update(_first_step(behaviour, movers[behaviour.object]))
            for joint in behaviour.joints:
                del held[joint]
                seen.add(joint)
        elif isinstance(behaviour, Hold):
            held[name] = behaviour.position
        elif name in held:
            raise ValueError(f"behaviour {behaviour.kind}: {name!r} belongs to a mover")
        elif isinstance(behaviour, Trigger):
            _check_trigger(behaviour)
            start[name] = behaviour.start if behaviour.begin is None else behaviour.begin
        elif isinstance(behaviour, Reaction):
            start[name] = behaviour.start
        else:
            _check_frames(behaviour)
            start.update((name, f.position) for f in behaviour.frames if frame_tick(f) == 0)
    return start, held


def _check_walk(walk: Walk, movers: Mapping[str, SceneObject]) -> None:
    if walk.object not in movers:
        raise ValueError(f"behaviour walk: {walk.object!r} is no mover")
    gaps = [math.dist(a, b) for a, b in itertools.pairwise(walk.route)]
    if not gaps or min(gaps) <= 0.0 or not min(walk.speed, walk.acceleration) > 0.0:
        raise ValueError(f"walk of {walk.object!r}: it needs a way, a speed and an acceleration")
    if walk.manner == "round" and math.dist(walk.route[0], walk.route[-1]) <= 0.0:
        raise ValueError(f"walk of {walk.object!r}: a round closes by itself")
    if min(walk.start, walk.pause) < 0.0:
        raise ValueError(f"walk of {walk.object!r}: times are never negative")


def _first_step(walk: Walk, mover: SceneObject) -> dict[str, float]:
    """Return where the mover's joints are when it stands on the first point of its route."""
    route = Route(walk)
    x, y = route.point(0.0)
    return dict(zip(walk.joints, chain_positions(mover, Pose2(x, y), route.yaw(0.0)), strict=True))


def _check_frames(behaviour: KeyFrames) -> None:
    times = [frame.time for frame in behaviour.frames]
    if times != sorted(times) or any(time < 0.0 for time in times):
        raise ValueError(f"key frames of joint {behaviour.joint!r} are not in order of time")


def _check_trigger(behaviour: Trigger) -> None:
    if behaviour.rearm is not None and behaviour.rearm <= behaviour.distance:
        raise ValueError(f"trigger of joint {behaviour.joint!r}: rearm must exceed distance")
    if behaviour.begin is not None and isinstance(behaviour.motion, Jump):
        raise ValueError(f"trigger of joint {behaviour.joint!r}: a jump begins at its start")
