"""Writer and reader of MCAP traces with ROS 2 messages in CDR."""

from daemon.trace._difference import TraceDifference, first_difference
from daemon.trace._model import (
    CommandTrack,
    ContactRecord,
    EventRecord,
    JointTrack,
    LatencyTrack,
    MotionTrack,
    PoseTrack,
    ProgressRecord,
    ScanTrack,
    Trace,
    TraceError,
)
from daemon.trace._reader import read_outputs, read_scene, read_spec, read_trace
from daemon.trace._recorder import MessageStream, Recorder
from daemon.trace._signals import JointSamples
from daemon.trace._statics import MovingLinks
from daemon.trace._views import decode_path, encode_costmap, encode_path
from daemon.trace._writer import PARTIAL, TraceWriter
from daemon.trace.messages import TOPICS, topics_of, warm_up

__all__ = [
    "PARTIAL",
    "TOPICS",
    "CommandTrack",
    "ContactRecord",
    "EventRecord",
    "JointSamples",
    "JointTrack",
    "LatencyTrack",
    "MessageStream",
    "MotionTrack",
    "MovingLinks",
    "PoseTrack",
    "ProgressRecord",
    "Recorder",
    "ScanTrack",
    "Trace",
    "TraceDifference",
    "TraceError",
    "TraceWriter",
    "decode_path",
    "encode_costmap",
    "encode_path",
    "first_difference",
    "read_outputs",
    "read_scene",
    "read_spec",
    "read_trace",
    "topics_of",
    "warm_up",
]
