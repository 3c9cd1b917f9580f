"""Options of the stand-in, in the style of `ros2 launch`: `name:=value`."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass, fields, replace
from pathlib import Path

NODES = ("map_server", "amcl", "controller_server", "planner_server", "bt_navigator")
MANAGER = "lifecycle_manager_navigation"

FAULT_BEGINS = "the fault begins"


@dataclass(frozen=True)
class Options:
    """Nodes, files and the faults of a stand-in; times in s. Faults are

    dies            `node` ends with `exit_code`, or by `signal`, `after` seconds of the first goal
    goal-aborted    the goal is aborted then, with `error_code` and `error_msg`
    no-server       the action servers vanish then
    goal-rejected   every goal is rejected
    dies-at-start   `node` ends as with `dies` while it is configured
    late-response   `node` answers a transition only when the manager has given it up
    """

    nodes: str = ",".join((*NODES, MANAGER))
    map: str = ""
    fault: str = ""
    node: str = "controller_server"
    after: float = 1.0
    seconds: float = 2.0
    exit_code: int = 3
    signal: int = 0
    once: str = ""
    """A file that the first start makes; later ones have no fault."""
    error_code: int = 104
    error_msg: str = "the stand-in was told to abort"

    def has(self, fault, node=None):
        """Return whether a fault is asked for (of this node, if one is named)."""
        return fault in self.fault.split(",") and (node is None or node == self.node)

    def end_process(self):
        """End the process as a crash does; the line before has the wall time."""
        print(f"[WARN] [{time.time()}] [standin]: {FAULT_BEGINS}")
        sys.stdout.flush()
        if self.signal:
            os.kill(os.getpid(), self.signal)
            time.sleep(60)
        os._exit(self.exit_code)


def read_options(arguments):
    """Return the options of `name:=value` words."""
    kinds = {field.name: type(field.default) for field in fields(Options)}
    words = (word.partition(":=") for word in arguments)
    return Options(**{name: kinds[name](value) for name, _, value in words})


def without_spent_fault(options):
    """Return the options of this start of the stack: without a fault that has come once."""
    if not options.once:
        return options
    try:
        Path(options.once).touch(exist_ok=False)
    except FileExistsError:
        return replace(options, fault="")
    return options


def say_interrupted():
    """Print that SIGINT came, and when [s of wall clock]."""
    print(f"[WARNING] [launch]: interrupted at {time.time():.3f}", flush=True)
