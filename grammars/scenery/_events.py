"""Reading what a sentence waits for: ``when …``."""

from __future__ import annotations

from typing import Final, Literal, TypeAlias, get_args

from grammars.scenery._reader import NodeReader
from grammars.scenery.model import EventPhrase, OnLeg, OnObject, OnWaypoint
from grammars.text.diagnostics import InputError, SyntaxNode, TypedNode


class RobotIsNearNode(TypedNode):
    """``when the robot is within 1.3 m of its hinge``: a distance, not an event."""

    body: str
    distance: SyntaxNode
    point: Literal["hinge", "foot", "leaf", "doorway"]

    def event(self, reader: NodeReader) -> EventPhrase:
        """Refuse to be one."""
        raise InputError.at(
            reader.where(self),
            "walks begin at a time or with an event, not with the robot's distance",
            "from 5 s, when leg 2 begins, when waypoint … is reached, when … fires",
        )


class LegBeginsNode(TypedNode):
    """``when leg 2 begins``."""

    leg: int

    def event(self, reader: NodeReader) -> OnLeg:
        """Return the event."""
        where = reader.where(self)
        if self.leg < 1:
            raise InputError.at(where, "legs are counted from 1", "when leg 1 begins")
        return OnLeg(self.leg, where)


class WaypointIsReachedNode(TypedNode):
    """``when waypoint living-room is reached``."""

    waypoint: str

    def event(self, reader: NodeReader) -> OnWaypoint:
        """Return the event."""
        return OnWaypoint(self.waypoint.strip('"'), reader.where(self))


class ObjectActsNode(TypedNode):
    """``when front_door fires`` or ``starts to move``."""

    path: SyntaxNode
    fires: bool

    def event(self, reader: NodeReader) -> OnObject:
        """Return the event."""
        act: Literal["fires", "moves"] = "fires" if self.fires else "moves"
        return OnObject(reader.path(self.path), act, reader.where(self))


EventNode: TypeAlias = RobotIsNearNode | LegBeginsNode | WaypointIsReachedNode | ObjectActsNode

EVENT_RULES: Final = get_args(EventNode)
"""Classes of syntax nodes, named like their rules."""
