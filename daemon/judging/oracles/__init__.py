"""Oracles: signals read from a trace, judged, with evidence. Never the simulator."""

from daemon.judging.oracles._judge import judge, judge_so_far, overall_outcome, warm_up
from daemon.judging.oracles._leading import judge_leading
from daemon.judging.oracles._obstacles import ObstaclePolygons
from daemon.judging.oracles._oracle_timeline import OracleTimeline, oracle_timeline
from daemon.judging.oracles._sampler import DOOR_CLEARANCE, SignalSampler
from daemon.judging.oracles._series import quantile_index
from daemon.judging.oracles._validity import trace_problems

__all__ = [
    "DOOR_CLEARANCE",
    "ObstaclePolygons",
    "OracleTimeline",
    "SignalSampler",
    "judge",
    "judge_leading",
    "judge_so_far",
    "oracle_timeline",
    "overall_outcome",
    "quantile_index",
    "trace_problems",
    "warm_up",
]
