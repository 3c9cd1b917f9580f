"""Runs every kernel of the stack once, with the argument types a run uses."""

from __future__ import annotations

from daemon.navigation.ros import amcl, costmap, dwa, move_base, navfn


def warm_up() -> None:
    """Warm up every component."""
    for component in (amcl, costmap, navfn, dwa, move_base):
        component.warm_up()
