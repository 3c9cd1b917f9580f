"""AMCL: adaptive Monte Carlo localisation, as the ROS Noetic package does it.

Written anew from the behaviour of the package (navigation ``noetic-devel``) after Thrun, Burgard
and Fox, Probabilistic Robotics (2005), and Fox (2003).
"""

from daemon.stacks.ros1.amcl._parameters import WITHOUT_EFFECT, AmclParameters, without_effect

__all__ = ["WITHOUT_EFFECT", "AmclParameters", "warm_up", "without_effect"]


def warm_up() -> None:
    """Update a few small filters with a scan of nothing but walls, then of nothing at all."""
    from daemon.stacks.ros1.amcl.node import warm_up as run

    run()
