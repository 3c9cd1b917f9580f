"""The traces of runs that are over: where they lie, and what they say of the way driven."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.batch.errors import DaemonError, Refused
from grammars.model.geometry import Pose2

if TYPE_CHECKING:
    from daemon.model.status import RunDetail
    from daemon.model.verbs import DaemonClient
    from daemon.model.verdicts import Verdict
    from grammars.model.geometry import Point2

_TRAIL_POINTS: Final = 4000
"""Points of a way at most: more of them would fall into the same dots of the map."""


@dataclass(frozen=True, slots=True)
class RecordingVersion:
    """Identity of a recording as it is shown: the digest of its trace, and its verdicts.

    The path of a trace identifies nothing: a run that is executed again writes the same file.
    """

    run: str
    sha256: str
    verdicts: tuple[Verdict, ...]


def recording_version(detail: RunDetail) -> RecordingVersion | None:
    """Return the version of the recording of a run, ``None`` while it has no result."""
    row = detail.row
    if row.result is None or not row.settled:
        return None
    return RecordingVersion(row.id, row.result.trace.sha256, row.verdicts)


@dataclass(frozen=True, slots=True)
class TraceSummary:
    """Where the robot of a finished run went, and how everything stood at its end; ``path`` is
    the trace.
    """

    run: str
    path: Path
    pose: Pose2
    joints: tuple[float, ...]
    reached: int
    trail: tuple[Point2, ...]


@dataclass(frozen=True, slots=True)
class UnavailableTrace:
    """A run that is over but has nothing to look at, and why, for people."""

    run: str
    why: str


def local_trace(detail: RunDetail, source: DaemonClient | None = None) -> Path | UnavailableTrace:
    """Return where the trace of a run lies on this machine, or why there is none.

    One that lies elsewhere is brought here if ``source`` is given; that may take a while. Another
    machine may have another file under the same path, so that the digest decides.
    """
    run, path = detail.row.id, Path(detail.row.trace)
    if not detail.row.settled:
        return UnavailableTrace(
            run, f"This run is {detail.row.state}: its trace is there when it is over."
        )
    if detail.row.result is None:
        what = f"This run was {detail.row.state}: there is nothing to look at."
        return UnavailableTrace(run, f"{what}\n\nr queues it again.")
    if not detail.row.trace:
        return UnavailableTrace(run, "No trace of this run was kept.")
    if source is not None and not _matches(detail):
        fetched = _fetch_trace(detail, source)
        # Of a file that is damaged, what can be read is shown all the same.
        return path if isinstance(fetched, UnavailableTrace) and path.is_file() else fetched
    if path.is_file():
        return path
    what = "Look at it where its worker is, or run it again."
    return UnavailableTrace(run, f"Its trace is not on this machine (any more): {path}\n\n{what}")


def _matches(detail: RunDetail) -> bool:
    """Whether the file at the place of a trace is that trace."""
    from daemon.batch.stores import matches_digest

    assert detail.row.result is not None
    trace = detail.row.result.trace
    return matches_digest(Path(detail.row.trace), trace.size, trace.sha256)


def _fetch_trace(detail: RunDetail, source: DaemonClient) -> Path | UnavailableTrace:
    from daemon.batch.stores import local_copy, trace_reference

    try:
        return local_copy(trace_reference(detail.row), source)
    except DaemonError as error:
        return UnavailableTrace(detail.row.id, f"Its trace cannot be brought here: {error}")


def can_fetch_trace(detail: RunDetail, source: DaemonClient) -> bool:
    """Whether the trace of a run lies elsewhere, and can be had from there as far as is known."""
    from daemon.batch.stores import is_url

    row = detail.row
    if row.result is None or not row.trace:
        return False
    if is_url(row.trace):
        return True
    if _matches(detail):
        return False
    # Only the daemon knows whether it can: asked for the first part, it says so.
    try:
        source.get(row.result.trace.sha256, 0, row.id)
    except Refused:
        return False
    return True


def read_trace_summary(
    detail: RunDetail, source: DaemonClient | None = None
) -> TraceSummary | UnavailableTrace:
    """Return the recorded way of a run that is over, or why its trace cannot be read here.

    One that lies elsewhere is brought here if ``source`` is given.
    """
    from daemon.trace import TraceError, read_trace

    run, path = detail.row.id, local_trace(detail, source)
    if isinstance(path, UnavailableTrace):
        return path
    try:
        trace = read_trace(path)
    except TraceError as error:
        said = "; ".join(d.message for d in error.findings)
        what = "Run it again, or copy the file anew from where its worker is."
        return UnavailableTrace(run, f"Its trace cannot be used: {said}: {path}\n\n{what}")
    way, joints = trace.ground_truth, trace.joints
    if not len(way.time):
        return UnavailableTrace(run, f"Its trace says nothing of where the robot was: {path}")
    every = max(1, len(way.time) // _TRAIL_POINTS)
    trail = tuple(zip(way.x[::every].tolist(), way.y[::every].tolist(), strict=True))
    return TraceSummary(
        run=run,
        path=path,
        pose=Pose2(float(way.x[-1]), float(way.y[-1]), float(way.yaw[-1])),
        joints=tuple(joints.position[-1].tolist()) if len(joints.time) else (),
        reached=trace.progress[-1].reached if trace.progress else 0,
        trail=trail,
    )
