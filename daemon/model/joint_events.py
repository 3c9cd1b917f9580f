"""What the log of a run says of joints that act by themselves, and how readers tell it apart.

The simulator writes these lines as events of the joint; they are part of the trace, so their
beginnings must stay what they are: readers of old traces go by them.
"""

from __future__ import annotations

from enum import StrEnum


class JointEvent(StrEnum):
    """Why a joint began to move; each is how its line in the log begins."""

    KEY_FRAME = "key frame "
    TRIGGERED = "triggered "
    REACTS = "reacts: "


def joint_event(text: str) -> JointEvent | None:
    """Return what a line of the log says of a joint, ``None`` when it is about something else."""
    return next((event for event in JointEvent if text.startswith(event)), None)
