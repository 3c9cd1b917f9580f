"""Oracles: signals read from a trace, judged, with evidence. Never the simulator.

Names are loaded when first asked for: numba and numpy only where something is judged.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from daemon.judging.oracles._judge import judge, judge_so_far, overall_outcome, warm_up
    from daemon.judging.oracles._leading import judge_leading
    from daemon.judging.oracles._leading_kind import leading_kind, oracle_scale
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
    "leading_kind",
    "oracle_scale",
    "oracle_timeline",
    "overall_outcome",
    "quantile_index",
    "trace_problems",
    "warm_up",
]

_MODULES: Final = {
    "DOOR_CLEARANCE": "_sampler",
    "ObstaclePolygons": "_obstacles",
    "OracleTimeline": "_oracle_timeline",
    "SignalSampler": "_sampler",
    "judge_leading": "_leading",
    "leading_kind": "_leading_kind",
    "oracle_scale": "_leading_kind",
    "oracle_timeline": "_oracle_timeline",
    "quantile_index": "_series",
    "trace_problems": "_validity",
}


def __getattr__(name: str) -> object:
    if name in __all__:
        return getattr(import_module(f"{__name__}.{_MODULES.get(name, '_judge')}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
