"""From a floor plan and scenery layers to one :class:`Scene`."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Final

from shapely.geometry import Polygon

from grammars.composition.catalogue import Catalogue
from grammars.composition.mirror import mirrored_joints, mirrored_links
from grammars.composition.placement import frames_of, place
from grammars.composition.positions import closed_positions, joint_positions
from grammars.composition.rings import canonical, settled, settled_point, settled_pose
from grammars.composition.settings import with_settings
from grammars.composition.solids import solids_of
from grammars.diagnostics import Diagnostic, InputError
from grammars.floorplan.model import FloorPlan
from grammars.kinematics import link_poses
from grammars.movers import is_mover
from grammars.scene import Doorway, Joint, Link, Region, Scene, SceneObject
from grammars.scenery.model import In, Instance, SceneryLayer
from grammars.values import Pose2

_STANDS_IN: Final = 0.5
"""Share of a closed leaf that must lie in a doorway for the object to count as standing in it."""


def compile_scene(plan: FloorPlan, layers: Sequence[SceneryLayer] = ()) -> Scene:
    """Return the world of ``plan`` with the objects of ``layers`` in it.

    Walls are cut by the openings that list them and become convex solids; objects stand in layer
    order. All coordinates are rounded to 1e-9 m, so that equal input gives equal digests.
    Raises :class:`InputError` with every unknown name and every object that cannot be placed.
    """
    doorways = _doorways(plan)
    catalogue = Catalogue(layers)
    objects: list[SceneObject] = []
    findings: list[Diagnostic] = []
    for instance in catalogue.instances.values():
        try:
            objects.append(_object(plan, doorways, catalogue, instance))
        except InputError as error:
            findings.extend(error.diagnostics)
    if findings:
        raise InputError(findings)
    placed = {o.name: o for o in objects}
    placed.update(with_settings(layers, catalogue, placed))
    return Scene(
        plan.name,
        tuple(Region(s.name, tuple(map(settled_point, s.outline))) for s in plan.spaces),
        doorways,
        solids_of(plan),
        tuple(placed.values()),
        _frames(plan) if any(is_mover(body.joints) for body in placed.values()) else (),
    )


def _frames(plan: FloorPlan) -> tuple[tuple[str, Pose2], ...]:
    return tuple((name, settled_pose(pose)) for name, pose in frames_of(plan))


def _doorways(plan: FloorPlan) -> tuple[Doorway, ...]:
    return tuple(
        Doorway(
            o.name,
            settled_pose(o.frame),
            canonical(o.footprint),
            settled(o.width),
            settled(o.z_min),
            settled(o.z_max),
        )
        for o in plan.openings
        if o.kind == "entryway"
    )


def _object(
    plan: FloorPlan, doorways: tuple[Doorway, ...], catalogue: Catalogue, instance: Instance
) -> SceneObject:
    model = catalogue.models[instance.model.text]
    placed = place(plan, instance, model)
    links, joints = model.links, model.joints
    if placed.mirrored:
        links = mirrored_links(links, placed.across)
        joints = mirrored_joints(joints, placed.across)
    signs = [-1.0 if placed.mirrored and j.kind == "revolute" else 1.0 for j in joints]
    closed = tuple(s * p + 0.0 for s, p in zip(signs, closed_positions(model), strict=True))
    body = SceneObject(
        instance.name,
        model.name,
        settled_pose(placed.pose),
        tuple(map(_settled_link, links)),
        tuple(map(_settled_joint, joints)),
        closed,
        instance.frozen,
        mirrored=placed.mirrored,
    )
    initial = dict(zip((j.name for j in joints), closed, strict=True))
    if instance.starts is not None:
        initial.update(joint_positions(body, model, instance.starts, ""))
    doorway = _doorway_of(instance, body, closed, doorways)
    return dataclasses.replace(body, initial=tuple(initial.values()), doorway=doorway)


def _doorway_of(
    instance: Instance,
    body: SceneObject,
    closed: tuple[float, ...],
    doorways: tuple[Doorway, ...],
) -> str:
    if is_mover(body.joints):
        return ""
    if isinstance(instance.place, In):
        name = instance.place.entryway.text
        return name if any(doorway.name == name for doorway in doorways) else ""
    return _doorway_around(body, closed, doorways)


def _settled_link(link: Link) -> Link:
    rings = tuple(canonical(ring) for ring in link.polygons)
    return Link(link.name, rings, link.mass, settled(link.z_min), settled(link.z_max))


def _settled_joint(joint: Joint) -> Joint:
    return Joint(
        joint.name,
        joint.kind,
        joint.parent,
        joint.child,
        settled_point(joint.anchor),
        (settled(joint.axis[0], 12), settled(joint.axis[1], 12)),
        joint.lower,
        joint.upper,
        joint.friction,
        joint.stiffness,
        joint.damping,
        joint.rest,
    )


def _doorway_around(
    body: SceneObject, closed: tuple[float, ...], doorways: tuple[Doorway, ...]
) -> str:
    """Return the doorway that most of the closed moving links lie in, or nothing."""
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
