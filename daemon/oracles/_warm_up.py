"""Loading the compiled kernels, the grammar and the messages of traces ahead of time."""

from __future__ import annotations

from importlib import import_module

import numpy as np

from daemon import trace
from daemon.oracles._kernel import box_clearance, cos_sin
from grammars.diagnostics import Where
from grammars.oracle import custom_signal_names, parse_oracle


def warm_up() -> None:
    """Compile or load what judging a trace takes, so that forked children do not."""
    import_module("daemon.oracles._judge")
    trace.warm_up()
    custom_signal_names()  # looks through all that is installed
    # A limit with a unit loads the registry of units.
    parse_oracle("warm-up", "always(clearance >= 0.1 m)", Where("warm-up"))
    cos_sin(np.zeros(1))
    box_clearance(
        np.zeros((1, 3)),
        np.zeros(2),
        np.ones(2),
        np.array([(2.0, 0.0), (3.0, 0.0), (3.0, 1.0)]),
        np.array([0, 3]),
        np.array([-1]),
        np.array([(2.5, 0.5, 1.0)]),
        np.empty((1, 0, 3)),
    )
