"""Oracles: signals read from a trace, judged, with evidence. Never the simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from daemon.oracles._course import Course, course_of
    from daemon.oracles._judge import judge, judge_prefix, overall
    from daemon.oracles._sampler import Sampler
    from daemon.oracles._validity import problems_of
    from daemon.oracles._warm_up import warm_up

__all__ = [
    "Course",
    "Sampler",
    "course_of",
    "judge",
    "judge_prefix",
    "overall",
    "problems_of",
    "warm_up",
]


def __getattr__(name: str) -> object:
    """Load the numerical libraries only when something is judged."""
    if name == "warm_up":
        from daemon.oracles._warm_up import warm_up

        return warm_up
    if name == "Sampler":
        from daemon.oracles._sampler import Sampler

        return Sampler
    if name == "problems_of":
        from daemon.oracles._validity import problems_of

        return problems_of
    if name in ("Course", "course_of"):
        from daemon.oracles import _course

        return getattr(_course, name)
    if name in __all__:
        from daemon.oracles import _judge

        return getattr(_judge, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
