"""AMCL: adaptive Monte Carlo localisation, as the ROS Noetic package does it.

Written anew from the behaviour of the package (navigation ``noetic-devel``) after Thrun, Burgard
and Fox, Probabilistic Robotics (2005), and Fox (2003). Reading parameters loads no
compiler: :class:`Amcl` is imported when it is first asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from daemon.stacks.ros1.amcl._parameters import WITHOUT_EFFECT, AmclParameters, without_effect

if TYPE_CHECKING:
    from daemon.stacks.ros1.amcl._amcl import Amcl, AmclPose

__all__ = ["WITHOUT_EFFECT", "Amcl", "AmclParameters", "AmclPose", "warm_up", "without_effect"]


def __getattr__(name: str) -> Any:
    if name in ("Amcl", "AmclPose"):
        from daemon.stacks.ros1.amcl import _amcl

        return getattr(_amcl, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def warm_up() -> None:
    """Compile or load every kernel once, so that forked children start without compiling."""
    from daemon.stacks.ros1.amcl._amcl import warm_up as run

    run()
