"""AMCL: adaptive Monte Carlo localisation, as the ROS Noetic package does it.

Written anew from the behaviour of the package (navigation ``noetic-devel``) after Thrun, Burgard
and Fox, Probabilistic Robotics (2005), and Fox (2003). Reading parameters loads no
compiler: :class:`Amcl` is imported when it is first asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from daemon.navigation.ros.amcl._parameters import WITHOUT_EFFECT, AmclParameters

if TYPE_CHECKING:
    from daemon.navigation.ros.amcl._amcl import Amcl, Localisation

__all__ = ["WITHOUT_EFFECT", "Amcl", "AmclParameters", "Localisation", "warm_up"]


def __getattr__(name: str) -> Any:
    if name in ("Amcl", "Localisation"):
        from daemon.navigation.ros.amcl import _amcl

        return getattr(_amcl, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def warm_up() -> None:
    """Compile or load every kernel once, so that forked children start without compiling."""
    from daemon.navigation.ros.amcl._warmup import warm_up as run

    run()
