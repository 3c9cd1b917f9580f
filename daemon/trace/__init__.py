"""MCAP traces: ROS 2 messages in CDR, written and read back."""

from daemon.trace.kinematics import MovingLinks
from daemon.trace.messages import warm_up
from daemon.trace.model import (
    CommandTrack,
    ContactRecord,
    EventRecord,
    JointTrack,
    Motion,
    PlanRecord,
    PoseTrack,
    ProgressRecord,
    ScanTrack,
    Trace,
    TraceError,
)
from daemon.trace.reader import read_scene, read_spec, read_trace
from daemon.trace.writer import PARTIAL, TraceWriter

__all__ = [
    "PARTIAL",
    "CommandTrack",
    "ContactRecord",
    "EventRecord",
    "JointTrack",
    "Motion",
    "MovingLinks",
    "PlanRecord",
    "PoseTrack",
    "ProgressRecord",
    "ScanTrack",
    "Trace",
    "TraceError",
    "TraceWriter",
    "read_scene",
    "read_spec",
    "read_trace",
    "warm_up",
]
