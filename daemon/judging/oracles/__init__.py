"""Oracles: they judge signals of a trace, never of the simulator, and give evidence."""

from daemon.judging.oracles._judge import (
    judge,
    judge_so_far,
    oracle_timeline,
    overall_outcome,
    warm_up,
    written_oracle,
)
from daemon.judging.oracles._leading import judge_leading
from daemon.judging.oracles._obstacles import footprint_box
from daemon.judging.oracles._sampler import DOOR_CLEARANCE, SignalSampler
from daemon.judging.oracles._validity import trace_problems

__all__ = [
    "DOOR_CLEARANCE",
    "SignalSampler",
    "footprint_box",
    "judge",
    "judge_leading",
    "judge_so_far",
    "oracle_timeline",
    "overall_outcome",
    "trace_problems",
    "warm_up",
    "written_oracle",
]
