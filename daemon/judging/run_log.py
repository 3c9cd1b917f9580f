"""Lines of the log of a run: its mission, its contacts, reports of the tested system."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from daemon.model.live_judgement import LogLine
from daemon.model.sut import BehaviorTreeLog, CollisionMonitorState, SpeedLimit
from daemon.trace import Trace

_SAME_TOUCH: Final = 0.5
"""Longest pause [s] between two contacts of one touch: bodies that bounce or scrape are in contact
in some steps and not in others."""


def run_log(trace: Trace) -> list[LogLine]:
    """Return the lines of a finished or running run, in the order of time."""
    events = (LogLine(event.time, event.source, event.text, event.level) for event in trace.events)
    lines = [*_mission(trace), *_touches(trace), *_reports(trace), *events]
    return sorted(lines, key=lambda line: line.time)


def ended_run_log(trace: Trace) -> tuple[LogLine, ...]:
    """Return the lines of a finished run; the last one says how it ended."""
    end = trace.ended or "cut off: the recording has no end"
    lines = run_log(trace)
    # If the system could not go on, its reason is an event already.
    note = "" if any(line.text == trace.note for line in lines) else trace.note
    return (*lines, LogLine(trace.valid_until, "run", f"{end}{f', {note}' if note else ''}"))


def _mission(trace: Trace) -> Iterator[LogLine]:
    names = [waypoint.id for waypoint in trace.spec.mission.waypoints]
    reported = 0
    for progress in trace.progress:
        for index in range(reported, min(progress.reached, len(names))):
            count = f"{index + 1} of {len(names)}"
            yield LogLine(progress.time, "mission", f"{names[index]} reached, {count}")
        reported = max(reported, progress.reached)
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
                    # Conditions fail all the time, but never run.
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
