"""What a trace tells besides signals, a line each: mission, contacts, words of what was tested."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from daemon.model.live_judgement import LogLine
from daemon.trace import Trace

_SAME_TOUCH: Final = 0.5
"""Contacts of two bodies that are not farther apart [s] are one touch: bodies that bounce or scrape
are in contact in some steps and not in others."""


def run_log(trace: Trace) -> list[LogLine]:
    """Return the lines of a run, over or not, in the order of time."""
    events = (LogLine(event.time, event.source, event.text, event.level) for event in trace.events)
    return sorted([*_mission(trace), *_touches(trace), *events], key=lambda line: line.time)


def _mission(trace: Trace) -> Iterator[LogLine]:
    names = [waypoint.id for waypoint in trace.spec.mission.waypoints]
    before = 0
    for progress in trace.progress:
        for index in range(before, min(progress.reached, len(names))):
            count = f"{index + 1} of {len(names)}"
            yield LogLine(progress.time, "mission", f"{names[index]} reached, {count}")
        before = max(before, progress.reached)
        if progress.state != "active":
            yield LogLine(progress.time, "mission", progress.state)


def _touches(trace: Trace) -> Iterator[LogLine]:
    last: dict[tuple[str, str], float] = {}
    for contact in trace.contacts:
        pair = (contact.first, contact.second)
        if pair not in last or contact.time - last[pair] > _SAME_TOUCH:
            text = f"{contact.first} touches {contact.second}"
            yield LogLine(contact.time, "contact", text, "warn")
        last[pair] = contact.time
