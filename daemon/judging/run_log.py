"""Lines of the log of a run: its mission, contacts, and what the tested system reported."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from daemon.model.live_judgement import LogLine
from daemon.model.sut import BehaviorTreeLog, CollisionMonitorState, SpeedLimit
from daemon.trace import Trace

_SAME_TOUCH: Final = 0.5
"""Contacts of two bodies that are not farther apart [s] are one touch: bodies that bounce or scrape
are in contact in some steps and not in others."""


def run_log(trace: Trace) -> list[LogLine]:
    """Return the lines of a run, over or not, in the order of time."""
    events = (LogLine(event.time, event.source, event.text, event.level) for event in trace.events)
    lines = [*_mission(trace), *_touches(trace), *_reports(trace), *events]
    return sorted(lines, key=lambda line: line.time)


def ended_run_log(trace: Trace) -> tuple[LogLine, ...]:
    """Return the lines of a run that is over; the last one says how it ended."""
    end = trace.ended or "cut off: the recording has no end"
    lines = run_log(trace)
    # The reason of a system that cannot go on is an event, too.
    note = "" if any(line.text == trace.note for line in lines) else trace.note
    return (*lines, LogLine(trace.valid_until, "run", f"{end}{f', {note}' if note else ''}"))


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


def _reports(trace: Trace) -> Iterator[LogLine]:
    """Yield recoveries and failures of the behaviour tree, interventions and speed limits."""
    for report in trace.reports:
        match report:
            case BehaviorTreeLog(time=time, changes=changes):
                for change in changes:
                    if change.starts_recovery:
                        yield LogLine(time, "behavior tree", f"{change.node} begins", "warn")
                    # Conditions fail all the time, but are never RUNNING.
                    elif (change.previous, change.current) == ("RUNNING", "FAILURE"):
                        yield LogLine(time, "behavior tree", f"{change.node} failed")
            case CollisionMonitorState(time=time):
                yield LogLine(time, "collision monitor", report.text or "no action")
            case SpeedLimit(time=time):
                yield LogLine(time, "speed limit", report.text or "none")


def _touches(trace: Trace) -> Iterator[LogLine]:
    last: dict[tuple[str, str], float] = {}
    for contact in trace.contacts:
        pair = (contact.first, contact.second)
        if pair not in last or contact.time - last[pair] > _SAME_TOUCH:
            text = f"{contact.first} touches {contact.second}"
            yield LogLine(contact.time, "contact", text, "warn")
        last[pair] = contact.time
