"""From a floor plan and scenery layers to a :class:`Scene` with placed objects and settings."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

from shapely.geometry import Polygon

from grammars.floorplan import FloorPlan, Space
from grammars.model.kinematics import link_poses
from grammars.model.movers import is_mover
from grammars.model.scene import Doorway, Joint, Link, Region, Scene, SceneObject
from grammars.scenery.composition._amounts import closed_positions, joint_positions
from grammars.scenery.composition._building import solids_of
from grammars.scenery.composition._catalogue import Catalogue
from grammars.scenery.composition._placement import (
    frames_of,
    mirrored_joints,
    mirrored_links,
    place_instance,
)
from grammars.scenery.composition._rings import canonical_ring, rounded, rounded_point, rounded_pose
from grammars.scenery.model import In, Instance, SceneryLayer, Setting, Starts
from grammars.text.diagnostics import Finding, Findings, gather, raise_all


def apply_settings(
    layers: Sequence[SceneryLayer], catalogue: Catalogue, placed: Mapping[str, SceneObject]
) -> dict[str, SceneObject]:
    """Return the objects with the settings of all layers applied; later layers win.

    Raises :class:`InputError` for unknown names, states and units.
    """
    objects = dict(placed)
    findings = Findings()
    for layer in layers:
        for setting in layer.settings:
            with findings.collecting():
                for target in catalogue.targets(layer, setting.subject):
                    body = objects[target.object]
                    objects[body.name] = _with(catalogue, body, setting, target.joint)
    findings.raise_errors()
    return objects


def _with(catalogue: Catalogue, body: SceneObject, setting: Setting, joint: str) -> SceneObject:
    if not isinstance(setting, Starts):
        return dataclasses.replace(body, frozen=True)
    initial = dict(zip((j.name for j in body.joints), body.initial, strict=True))
    model = catalogue.model_of(body.name)
    initial.update(joint_positions(body, model, setting.position, joint))
    return dataclasses.replace(body, initial=tuple(initial.values()))


def refuse_unapplied(scene: Scene, layers: Sequence[SceneryLayer], catalogue: Catalogue) -> None:
    """Raise for objects and settings in ``layers`` that are not part of ``scene``.

    Layers with objects or settings must take part in compiling the scene, because behaviours
    cannot add them.
    """
    bodies = {body.name: body for body in scene.objects}
    hint = "name this layer among the objects, not only among the behaviours"
    findings = Findings()
    for instance in catalogue.instances.values():
        if instance.name not in bodies:
            findings.error(instance.where, f"{instance.name} is not in the scene", hint)
    findings.raise_errors()
    # Settings without an effect are accepted.
    objects = apply_settings(layers, catalogue, bodies)
    for layer in layers:
        for setting in layer.settings:
            for target in catalogue.targets(layer, setting.subject):
                if objects[target.object] != bodies[target.object]:
                    message = f"the scene lacks this setting of {target.object}"
                    findings.error(setting.where, message, hint)
    findings.raise_errors()


_STANDS_IN: Final = 0.5
"""Share of a closed leaf that must lie in a doorway for its object to count as standing in it."""


def compile_scene(plan: FloorPlan, layers: Sequence[SceneryLayer] = ()) -> Scene:
    """Return the scene of ``plan`` with the objects of ``layers``, in layer order.

    Walls become convex solids with their openings cut out. Coordinates are rounded to 1e-9 m, so
    that equal input gives equal digests. Raises :class:`InputError` with all objects that cannot
    be placed, otherwise with all invalid settings.
    """
    doorways = _doorways(plan)
    catalogue = Catalogue(layers)
    _refuse_names_of_places(plan, catalogue)
    bodies = gather(
        partial(_object, plan, doorways, catalogue, instance)
        for instance in catalogue.instances.values()
    )
    placed = apply_settings(layers, catalogue, {body.name: body for body in bodies})
    frames = tuple((name, rounded_pose(pose)) for name, pose in frames_of(plan).items())
    return Scene(
        plan.name,
        tuple(_region(space) for space in plan.spaces),
        doorways,
        solids_of(plan),
        tuple(placed.values()),
        # Only routes of movers need them, and they change the digest of the scene.
        frames if any(map(is_mover, catalogue.joints())) else (),
    )


def _refuse_names_of_places(plan: FloorPlan, catalogue: Catalogue) -> None:
    """Raise :class:`InputError` for objects with the name of a part of the building."""
    kinds = {o.name: o.kind for o in plan.openings} | {f.id: "feature" for f in plan.features}
    kinds |= dict.fromkeys((space.name for space in plan.spaces), "space")
    raise_all(
        Finding(
            instance.where,
            f'object "{name}" has the name of a part of the floor plan: its {kinds[name]}',
            "rename the object: oracles find both by their name",
        )
        for name, instance in catalogue.instances.items()
        if name in kinds
    )


def _region(space: Space) -> Region:
    outline, *holes = (tuple(map(rounded_point, ring)) for ring in (space.outline, *space.holes))
    return Region(space.name, outline, tuple(holes))


def _doorways(plan: FloorPlan) -> tuple[Doorway, ...]:
    return tuple(
        Doorway(
            o.name,
            rounded_pose(o.frame),
            ring,
            rounded(o.width),
            rounded(o.z_min),
            rounded(o.z_max),
        )
        for o in plan.openings
        # A wall without thickness (reported elsewhere) has a line as footprint: no passage.
        if o.kind == "entryway" and len(ring := canonical_ring(o.footprint)) > 2
    )


def _object(
    plan: FloorPlan, doorways: tuple[Doorway, ...], catalogue: Catalogue, instance: Instance
) -> SceneObject:
    model = catalogue.models[instance.model.text]
    placement = place_instance(plan, instance, model)
    links, joints = model.links, model.joints
    if placement.mirrored:
        links = mirrored_links(links, placement.across)
        joints = mirrored_joints(joints, placement.across)
    # Joint limits are mirrored already, positions of states are not.
    signs = [-1.0 if placement.mirrored and j.kind == "revolute" else 1.0 for j in joints]
    closed = tuple(s * p + 0.0 for s, p in zip(signs, closed_positions(model), strict=True))
    body = SceneObject(
        instance.name,
        model.name,
        rounded_pose(placement.pose),
        tuple(map(_rounded_link, links)),
        tuple(map(_rounded_joint, joints)),
        closed,
        instance.frozen,
        mirrored=placement.mirrored,
    )
    initial = dict(zip((j.name for j in joints), closed, strict=True))
    if instance.starts is not None:
        initial.update(joint_positions(body, model, instance.starts, ""))
    doorway = _doorway_of(instance, body, closed, doorways)
    return dataclasses.replace(body, initial=tuple(initial.values()), doorway=doorway)


def _rounded_link(link: Link) -> Link:
    rings = tuple(canonical_ring(ring) for ring in link.polygons)
    return Link(link.name, rings, link.mass, rounded(link.z_min), rounded(link.z_max))


def _rounded_joint(joint: Joint) -> Joint:
    axis = (rounded(joint.axis[0], 12), rounded(joint.axis[1], 12))
    return dataclasses.replace(joint, anchor=rounded_point(joint.anchor), axis=axis)


def _doorway_of(
    instance: Instance,
    body: SceneObject,
    closed: tuple[float, ...],
    doorways: tuple[Doorway, ...],
) -> str:
    """Return the entryway of an object, or the doorway with most of its closed moving links."""
    if is_mover(body.joints):
        return ""
    if isinstance(instance.place, In):
        name = instance.place.entryway.text
        return name if any(doorway.name == name for doorway in doorways) else ""
    moving = {j.child for j in body.joints}
    poses = link_poses(body, closed)
    leaves = [
        Polygon(poses[link.name].apply_ring(ring))
        for link in body.links
        if link.name in moving
        for ring in link.polygons
    ]
    best, name = _STANDS_IN * sum(leaf.area for leaf in leaves), ""
    for doorway in doorways if leaves else ():
        passage = Polygon(doorway.footprint)
        covered = sum(passage.intersection(leaf).area for leaf in leaves)
        if covered > best:
            best, name = covered, doorway.name
    return name
