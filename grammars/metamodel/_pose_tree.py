"""The poses of a composed graph are one tree from the world, and one of each object model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Final

from grammars.diagnostics import did_you_mean
from grammars.metamodel._nodes import Node, Nodes
from grammars.metamodel._vocabulary import FP, GEOM, OBJ, REL, local_name

_SHOWN: Final = 4
_MOST_LOOPS: Final = 50


def check_pose_tree(nodes: Nodes, found: Nodes, *, partial: bool) -> None:
    """Report loops of poses, and frames that no chain of poses connects to the world."""
    frames = [node.id for node in nodes.of_type(GEOM["Frame"])]
    links = _Forest(frames)
    tree: dict[str, list[Node]] = {}
    placing: dict[str, list[Node]] = {}
    looping: list[Node] = []
    for pose in nodes.of_type(REL["Pose"]):
        of, wrt = _ends(pose)
        if of and wrt:
            placing.setdefault(of, []).append(pose)
            if links.join(of, wrt):
                tree.setdefault(of, []).append(pose)
                tree.setdefault(wrt, []).append(pose)
            else:
                looping.append(pose)
    for pose in looping[:_MOST_LOOPS]:
        _report_loop(found, pose, tree, placing)
    roots, defined = _roots(nodes), frozenset(frames)
    anchors = {links.top(root) for root in roots}
    if partial:
        anchors |= {links.top(id) for id in links.known() if id not in defined}
    plans = nodes.of_type(FP["FloorPlan"])
    if plans and not any(_is_world(nodes, root) for root in roots):
        known = map(local_name, frames)
        message = "there is no frame world-frame to start from"
        found.error(plans[0].id, message, did_you_mean("world-frame", known))
        return
    loose: dict[str, list[str]] = {}
    for frame in frames:
        if links.top(frame) not in anchors:
            loose.setdefault(links.top(frame), []).append(frame)
    for group in loose.values():
        _report_loose(nodes, found, group)


def _ends(pose: Node) -> tuple[str, str]:
    return pose.ref(REL["of"]) or "", pose.ref(REL["with-respect-to"]) or ""


def _report_loop(
    found: Nodes, pose: Node, tree: dict[str, list[Node]], placing: dict[str, list[Node]]
) -> None:
    """Name the frames that make the loop by being placed more than once in it."""
    loop = [pose, *_path(tree, *_ends(pose))]
    times = Counter(_ends(step)[0] for step in loop)
    often = [frame for frame, count in times.items() if count > 1]
    most = max((len(placing[frame]) for frame in often), default=0)
    for frame in often:
        if len(placing[frame]) == most:
            against = ", ".join(local_name(_ends(p)[1]) for p in placing[frame][:_SHOWN])
            found.error(
                frame,
                f"{local_name(frame)} is placed {most} times: with respect to {against}",
                "do several things share this identifier? Give each its own: <space>-<name>",
            )
    if not often:
        message = f"pose {local_name(pose.id)} closes a loop of poses"
        found.error(pose.id, message, "poses are a tree: one way from the world to every frame")


def _path(tree: dict[str, list[Node]], start: str, end: str) -> list[Node]:
    """Return the poses of the tree on the way between two frames."""
    came: dict[str, Node | None] = {start: None}
    queue = [start]
    for frame in queue:
        for pose in tree.get(frame, []):
            other = next((e for e in _ends(pose) if e != frame), frame)
            if other not in came:
                came[other] = pose
                queue.append(other)
    path: list[Node] = []
    step = came.get(end)
    while step is not None:
        path.append(step)
        end = next((e for e in _ends(step) if e != end), start)
        step = came.get(end)
    return path


def _report_loose(nodes: Nodes, found: Nodes, group: list[str]) -> None:
    instances = {
        str(instance.ref(OBJ["frame"])): instance
        for instance in nodes.of_type(OBJ["ObjectInstance"])
    }
    names = ", ".join(local_name(frame) for frame in group[:_SHOWN])
    more = ", …" if len(group) > _SHOWN else ""
    hint = "add a pose of it with respect to a frame of the floor plan"
    for frame in group:
        if frame in instances:
            name = local_name(instances[frame].id)
            message = f"instance {name} is not connected to the world"
            found.error(instances[frame].id, message, hint)
            return
    found.error(group[0], f"no chain of poses connects {names}{more} to the world", hint)


def _roots(nodes: Nodes) -> list[str]:
    roots = [id for id in nodes.by_id if local_name(id) == "world-frame"]
    for kind, predicate in (("WorldFrame", "frame"), ("Object", "object-frame")):
        for node in nodes.of_type(OBJ[kind]):
            roots.extend(node.refs(OBJ[predicate]))
    return roots


def _is_world(nodes: Nodes, frame: str) -> bool:
    declared = any(frame in node.refs(OBJ["frame"]) for node in nodes.of_type(OBJ["WorldFrame"]))
    return declared or local_name(frame) == "world-frame"


class _Forest:
    """Disjoint sets of frames (union by path halving)."""

    def __init__(self, members: Iterable[str]) -> None:
        self._above = {member: member for member in members}

    def known(self) -> list[str]:
        return list(self._above)

    def top(self, member: str) -> str:
        above = self._above
        above.setdefault(member, member)
        while above[member] != member:
            above[member] = above[above[member]]
            member = above[member]
        return member

    def join(self, one: str, other: str) -> bool:
        """Put two sets together; return whether they were apart."""
        a, b = self.top(one), self.top(other)
        self._above[a] = b
        return a != b
