"""Walls of spaces in their own frame, and the place of spaces in the world.

A placement relates a frame of the space to another frame:
``world_from_space = world_from_wrt @ T(x, y, yaw) @ inverse(space_from_of)``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from grammars.floorplan._attributes import ElementReader, Location
from grammars.floorplan.model import Placement, Space, Wall
from grammars.model.geometry import Point2, Pose2, Ring
from grammars.text.diagnostics import InputError, SourceText, SyntaxNode, Where, did_you_mean

IDENTITY = Pose2()


@dataclass(slots=True, eq=False)
class SpaceDraft:
    """Space during compilation; after errors its outline is empty or its sizes are NaN.

    ``own`` is the wall index of the ``of`` frame. ``against`` and ``other`` are the space and the
    wall index of the ``wrt`` frame (no space: the world). An index of ``None`` means the frame of
    the space itself.
    """

    node: SyntaxNode
    name: str
    ring: Ring
    thickness: float
    height: float
    location: Location
    own: int | None = None
    against: SpaceDraft | None = None
    other: int | None = None

    def frame(self, wall: int | None) -> Pose2:
        """Return the frame of an own wall, or of the space itself, in the space frame."""
        return IDENTITY if wall is None else wall_frames(self.ring)[wall]


def wall_frames(ring: Ring) -> tuple[Pose2, ...]:
    """Return the frame of every edge: at its middle, x along it, y to its left."""
    frames = []
    for (x0, y0), (x1, y1) in zip(ring, ring[1:] + ring[:1], strict=True):
        frames.append(Pose2((x0 + x1) / 2, (y0 + y1) / 2, math.atan2(y1 - y0, x1 - x0)))
    return tuple(frames)


def outer_corners(ring: Ring, thickness: float) -> Ring:
    """Return the corners of the offset outline, mitred.

    ``O_i = P_i + t (n_(i-1) + n_i) / (1 + n_(i-1) . n_i)`` with the left normals n of the edges.
    The formula also holds for collinear neighbours. It fails only for a spike, which the caller
    must refuse.
    """
    normals: list[Point2] = []
    for (x0, y0), (x1, y1) in zip(ring, ring[1:] + ring[:1], strict=True):
        length = math.hypot(x1 - x0, y1 - y0)
        normals.append(((y0 - y1) / length, (x1 - x0) / length))
    corners: list[Point2] = []
    for k, (x, y) in enumerate(ring):
        (ax, ay), (bx, by) = normals[k - 1], normals[k]
        # The mitre has no limit, as in the published tools: a sharp corner reaches far out.
        reach = thickness / (1.0 + ax * bx + ay * by)
        corners.append((x + reach * (ax + bx), y + reach * (ay + by)))
    return tuple(corners)


class PlanReader(ElementReader):
    """Reader of one plan, with its ``spaces`` by name."""

    def __init__(self, source: SourceText) -> None:
        super().__init__(source)
        self.spaces: dict[str, SpaceDraft] = {}

    def refusal(self, node: SyntaxNode, message: str, hint: str = "") -> InputError:
        """Return an error that ends the reading of a reference."""
        return InputError.at(self.where(node), message, hint)

    def space(self, node: SyntaxNode) -> SpaceDraft:
        """Return the space that a frame reference names; raises :class:`InputError`."""
        if node.name not in self.spaces:
            hint = did_you_mean(node.name, self.spaces)
            raise self.refusal(node, f'unknown space "{node.name}"', hint)
        return self.spaces[node.name]

    def wall(self, node: SyntaxNode, draft: SpaceDraft) -> int | None:
        """Return the wall index of a frame reference, ``None`` for the frame of the space."""
        return self.wall_index(node, draft) if node.index else None

    def wall_index(self, node: SyntaxNode, draft: SpaceDraft) -> int:
        """Return the wall index of a reference to a wall; raises :class:`InputError`."""
        index, count = int(node.index), len(draft.ring)
        if not draft.ring:
            return index
        if not -count <= index < count:
            message = f'wall index {index}: space "{draft.name}" has walls 0..{count - 1}'
            raise self.refusal(node, message)
        # Version 2 of the published tools accepts it, so plans may contain it.
        if index < 0:
            message = f"wall index {index} counts from the end"
            self.warning(node, message, f"write walls[{index + count}]")
        return index % count


def resolve_placement(draft: SpaceDraft, reader: PlanReader) -> None:
    """Resolve the frames of a space's location and check its flags."""
    location = draft.location
    if not {"of", "wrt"} <= location.parts.keys():
        return
    for resolve in (_resolve_of, _resolve_wrt):
        with reader.collecting():
            resolve(draft, location, reader)
    _check_flags(draft, location, reader)


def _resolve_of(draft: SpaceDraft, location: Location, reader: PlanReader) -> None:
    reference = location.parts["of"].frame
    if reference.name not in ("this", draft.name):
        message = f'"of" names a frame of the space itself, not "{reference.name}"'
        raise reader.refusal(reference, message, 'write "of: this" or "of: this.walls[0]"')
    draft.own = reader.wall(reference, draft)


def _resolve_wrt(draft: SpaceDraft, location: Location, reader: PlanReader) -> None:
    reference = location.parts["wrt"].frame
    if reference.name == "world":
        if reference.index:
            raise reader.refusal(reference, "the world has no walls")
        return
    if reference.name in ("this", draft.name):
        message = f'space "{draft.name}" is placed against itself'
        raise reader.refusal(reference, message, 'place it against "world" or another space')
    draft.against = reader.space(reference)
    draft.other = reader.wall(reference, draft.against)


def _check_flags(draft: SpaceDraft, location: Location, reader: ElementReader) -> None:
    wall_to_wall = bool(location.parts["of"].frame.index and location.parts["wrt"].frame.index)
    spaced = location.parts.get("spaced")
    if spaced is not None:
        if location.parts["wrt"].frame.name == "world":
            reader.error(spaced, '"spaced" means the gap between two walls, but "wrt" is the world')
        elif not wall_to_wall:
            reader.warning(spaced, '"spaced" has no effect: it needs a wall in "of" and in "wrt"')
        if location.get("translation.y"):
            reader.error(
                location.parts["translation"],
                'a y translation and "spaced" exclude each other',
                "spaced sets the gap to the thickness of both walls",
            )
    unaligned = location.parts.get("not aligned")
    if unaligned is not None and not wall_to_wall:
        reader.warning(
            unaligned, '"not aligned" has no effect: it needs a wall in "of" and in "wrt"'
        )


def check_anchored(drafts: list[SpaceDraft], reader: ElementReader) -> None:
    """Report every loop of placements, whose spaces have no place in the world."""
    # Every space is walked over once; a walk that ends on a space of its own turn went in a circle.
    state: dict[int, int] = {}
    for turn, start in enumerate(drafts):
        path: list[SpaceDraft] = []
        draft: SpaceDraft | None = start
        while draft is not None and id(draft) not in state:
            state[id(draft)] = turn
            path.append(draft)
            draft = draft.against
        if draft is not None and state[id(draft)] == turn:
            loop = path[next(k for k, d in enumerate(path) if d is draft) :]
            names = " -> ".join(f'"{d.name}"' for d in [*loop, draft])
            reader.error(
                loop[0].node,
                f"the placements {names} form a loop: nothing ties them to the world",
                'place one of them "wrt: world"',
            )


def pose_in_world(draft: SpaceDraft, world: dict[str, Pose2]) -> Pose2:
    """Return the world pose of a space; ``world`` already holds that of its ``against``."""
    other = draft.against
    # World(space) = World(wrt) T inverse(M(space <- of)).
    base = IDENTITY if other is None else world[other.name] @ other.frame(draft.other)
    return base @ offset_of(draft) @ draft.frame(draft.own).inverse()


def offset_of(draft: SpaceDraft) -> Pose2:
    """Return the transform from the ``of`` frame to the ``wrt`` frame of a space."""
    location = draft.location
    x, y = location.get("translation.x"), location.get("translation.y")
    yaw = location.get("rotation.z")
    other = draft.against
    if other is not None and draft.own is not None and draft.other is not None:
        if "spaced" in location:
            y += draft.thickness + other.thickness
        if "not aligned" not in location:
            # The half turn makes two walls face each other, y against y. As in the published tools,
            # it also applies to counter-clockwise outlines, where it mirrors.
            yaw += math.pi
    return Pose2(x, y, yaw)


def frame_id(name: str, wall: int | None) -> str:
    """Return the published frame identifier of a space (no name: the world) or its wall."""
    return f"{name or 'world'}-frame" if wall is None else f"{name}-wall-{wall}-frame"


def place_all(drafts: list[SpaceDraft]) -> dict[str, Pose2]:
    """Return the world pose of every space; placements must be free of loops."""
    # Not recursive: a chain of rooms may be longer than the call stack.
    world: dict[str, Pose2] = {}
    for start in drafts:
        chain: list[SpaceDraft] = []
        draft: SpaceDraft | None = start
        while draft is not None and draft.name not in world:
            chain.append(draft)
            draft = draft.against
        for link in reversed(chain):
            world[link.name] = pose_in_world(link, world)
    return world


def build_space(draft: SpaceDraft, pose: Pose2, reader: ElementReader) -> Space:
    """Return the space with its walls in the world frame."""
    placement = Placement(
        frame_id(draft.name, draft.own),
        frame_id(draft.against.name if draft.against else "", draft.other),
        offset_of(draft),
        tuple((x, y, 0.0) for x, y in draft.ring),
    )
    where = reader.where(draft.node)
    size = draft.thickness, draft.height
    return space_at(draft.name, pose, draft.ring, *size, where, placement)


def space_at(
    name: str,
    pose: Pose2,
    ring: Ring,
    thickness: float,
    height: float,
    where: Where,
    placement: Placement | None = None,
) -> Space:
    """Return a space with the outline ``ring`` in its own frame, and its walls."""
    count = len(ring)
    frames, outer = wall_frames(ring), outer_corners(ring, thickness)
    walls = []
    for k in range(count):
        after = (k + 1) % count
        footprint = pose.apply_ring((outer[k], outer[after], ring[after], ring[k]))
        length = math.dist(ring[k], ring[after])
        walls.append(Wall(name, k, pose @ frames[k], length, thickness, height, footprint))
    return Space(name, pose, pose.apply_ring(ring), tuple(walls), where, placement)
