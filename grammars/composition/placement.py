"""Where objects stand: in a frame of the floor plan, or fitted into an entryway."""

from __future__ import annotations

from grammars.composition.entryway import Placed, place_in_entryway
from grammars.diagnostics import Diagnostic, InputError, Where, did_you_mean
from grammars.floorplan.model import FloorPlan
from grammars.scenery.model import At, FrameName, Instance, ObjectModel
from grammars.values import Pose2


def place(plan: FloorPlan, instance: Instance, model: ObjectModel) -> Placed:
    """Return where ``instance`` stands; raises :class:`InputError` for what cannot be."""
    if isinstance(instance.place, At):
        at = instance.place
        if at.inside:
            _check_space(plan, at.frame)
        return Placed(frame_named(plan, at.frame) @ Pose2(at.x, at.y, at.yaw))
    return place_in_entryway(plan, instance, model, instance.place)


def _check_space(plan: FloorPlan, name: FrameName) -> None:
    """Only a space has an inside that ``x`` and ``y`` could be meant in."""
    spaces = [s.name for s in plan.spaces]
    if name.name in spaces:
        return
    if any(o.name == name.name for o in plan.openings):
        message = f"x and y are meant in a space, {name} is an opening"
        raise InputError(Diagnostic(name.where, message, f"write at {name}, x …"))
    hint = did_you_mean(name.name, spaces)
    raise InputError(Diagnostic(name.where, f'there is no space "{name}"', hint))


def frames_of(plan: FloorPlan) -> tuple[tuple[str, Pose2], ...]:
    """Return the world poses of all frames that :func:`frame_named` knows but ``world``."""
    frames: dict[str, Pose2] = {}
    for space in plan.spaces:
        frames[space.name] = space.frame
        for number, wall in enumerate(space.walls):
            frames[f"{space.name}.walls[{number}]"] = wall.frame
    for opening in plan.openings:
        frames.setdefault(opening.name, opening.frame)
    for feature in plan.features:
        frames[f"{feature.space}.{feature.name}" if feature.space else feature.name] = feature.frame
        frames.setdefault(feature.id, feature.frame)
        if sum(f.name == feature.name for f in plan.features) == 1:
            frames.setdefault(feature.name, feature.frame)
    return tuple(frames.items())


def frame_named(plan: FloorPlan, name: FrameName) -> Pose2:
    """Return the world pose of a frame; raises :class:`InputError` with the closest name."""
    if name.name == "world" and name.wall is None and not name.part:
        return Pose2()
    space = next((s for s in plan.spaces if s.name == name.name), None)
    if name.wall is not None or name.part:
        if space is None:
            hint = did_you_mean(name.name, (s.name for s in plan.spaces))
            raise InputError(Diagnostic(name.where, f'there is no space "{name.name}"', hint))
        if name.wall is not None:
            if not 0 <= name.wall < len(space.walls):
                hint = f"it has walls 0 to {len(space.walls) - 1}"
                raise InputError(Diagnostic(name.where, f"there is no {name}", hint))
            return space.walls[name.wall].frame
        inside = {f.name: f.frame for f in plan.features if f.space == space.name}
        return _known(inside, name.part, f"feature in {space.name}", name.where)
    frames = {f.name: f.frame for f in plan.features}
    frames.update((f.id, f.frame) for f in plan.features)
    frames.update((o.name, o.frame) for o in plan.openings)
    frames.update((s.name, s.frame) for s in plan.spaces)
    doubles = [f for f in plan.features if f.name == name.name]
    if len(doubles) > 1 and space is None:
        hint = " or ".join(f"{f.space}.{f.name}" if f.space else f.id for f in doubles)
        raise InputError(Diagnostic(name.where, f'"{name}" may mean several features', hint))
    return _known(frames, name.name, "space, opening or feature", name.where)


def _known(frames: dict[str, Pose2], name: str, kind: str, where: Where) -> Pose2:
    if name not in frames:
        hint = did_you_mean(name, (*frames, "world"))
        raise InputError(Diagnostic(where, f'there is no {kind} "{name}" in the floor plan', hint))
    return frames[name]
