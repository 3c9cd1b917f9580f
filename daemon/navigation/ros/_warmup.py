"""Runs every kernel of the stack once, with the argument types a run uses."""

from __future__ import annotations

import numpy as np

from daemon.navigation.ros import amcl, costmap, dwa, move_base, navfn
from daemon.navigation.ros._telemetry import LocalPlanLog, PlanLog
from grammars.values import Pose2


def warm_up() -> None:
    """Warm up every component, and what is recorded of them."""
    for component in (amcl, costmap, navfn, dwa, move_base):
        component.warm_up()
    log = PlanLog()
    log.take(0.0, np.zeros((2, 3)))
    log.take(9.0, np.zeros((2, 3)))
    LocalPlanLog().take(0.0, np.zeros((2, 2)), Pose2())
