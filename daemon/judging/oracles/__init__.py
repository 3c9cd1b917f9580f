"""Oracles: signals read from a trace, judged, with evidence. Never the simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from daemon.judging.oracles._judge import (
        judge,
        judge_prefix,
        overall_outcome,
        trace_problems,
        warm_up,
    )
    from daemon.judging.oracles._oracle_timeline import OracleTimeline, oracle_timeline
    from daemon.judging.oracles._sampler import SignalSampler

__all__ = [
    "OracleTimeline",
    "SignalSampler",
    "judge",
    "judge_prefix",
    "oracle_timeline",
    "overall_outcome",
    "trace_problems",
    "warm_up",
]


def __getattr__(name: str) -> object:
    """Load the numerical libraries only when something is judged."""
    if name == "warm_up":
        from daemon.judging.oracles._judge import warm_up

        return warm_up
    if name == "Sampler":
        from daemon.judging.oracles._sampler import SignalSampler

        return SignalSampler
    if name == "problems_of":
        from daemon.judging.oracles._judge import trace_problems

        return trace_problems
    if name in ("Course", "course_of"):
        from daemon.judging.oracles import _oracle_timeline

        return getattr(_oracle_timeline, name)
    if name in __all__:
        from daemon.judging.oracles import _judge

        return getattr(_judge, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
