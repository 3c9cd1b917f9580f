"""What the stand-in is told on its command line, in the style of `ros2 launch`: `name:=value`."""

from __future__ import annotations

import os
import signal
import sys
import time
from dataclasses import dataclass, fields, replace
from pathlib import Path

import yaml

NODES = ("map_server", "amcl", "controller_server", "planner_server", "bt_navigator")
MANAGER = "lifecycle_manager"

FAULTS = {
    "hang": "controller: stops answering after `after` cycles, its process stays",
    "crash": "controller: ends with `exit_code`, or by `signal`, after `after` cycles",
    "crash-at-start": "`node` ends in the same ways while it is configured",
    "fails-first": "the process of `node` ends at once, `starts` times, counted in `count_file`",
    "late": "controller: sleeps `seconds` of wall time in every `every`-th cycle",
    "wrong-frame": "amcl calls the map frame `world` in what it publishes to tf",
    "no-tf": "amcl never publishes a transform",
    "goal-rejected": "every goal is rejected",
    "goal-aborted": "goals are aborted after `after` cycles with `error_code`, `error_msg`",
    "no-server": "the action servers vanish after `after` cycles of a goal",
    "never-ready": "`node` is never activated",
    "clock-start": "bring-up fails when the clock begins at 100 s or later, as Nav2's costmap does",
    "late-acknowledge": "a goal is acknowledged `seconds` of wall time late",
    "ignore-sigint": "nodes ignore SIGINT, as does the launcher",
    "orphans": "the launcher leaves its nodes behind, in sessions of their own",
    "chatter": "`node` logs 60 kB/s of wall time to the console and to rosout",
}


@dataclass(frozen=True)
class Options:
    """Lengths in m, angles in rad, times in s; defaults suit the courier robot of the demo."""

    map: str = ""
    params_file: str = ""
    namespace: str = ""
    use_sim_time: bool = True
    stamped: str = "auto"
    global_frame: str = "map"
    odom_frame: str = "odom"
    base_frame: str = "base_link"
    speed: float = 0.5
    turn_rate: float = 1.0
    radius: float = 0.3
    period: float = 0.05
    blocked_for: float = 30.0
    one_process: bool = False
    respawn: bool = False
    shutdown_on_exit: bool = False

    fault: str = ""
    node: str = "controller_server"
    after: int = 40
    every: int = 10
    seconds: float = 2.0
    exit_code: int = 3
    signal: int = 0
    starts: int = 1
    count_file: str = ""
    error_code: int = 104
    error_msg: str = "the stand-in was told to abort"

    def has(self, fault, node=None):
        """Whether a fault is wanted (of this node, if one is named)."""
        return fault in self.fault.split(",") and (node is None or node == self.node)

    def end_process(self):
        """Die as a crashed process does: without a word to anybody."""
        sys.stdout.flush()
        if self.signal:
            signal.signal(self.signal, signal.SIG_DFL)
            os.kill(os.getpid(), self.signal)
            time.sleep(60)
        os._exit(self.exit_code)


def read_options(arguments):
    """Options from `name:=value` words, on top of those in `params_file`.

    Raises SystemExit with a sentence for what is not understood.
    """
    given = {}
    for word in arguments:
        name, sign, value = word.partition(":=")
        if not sign:
            raise SystemExit(f"{word}: write name:=value")
        given[name] = value
    if file := given.get("params_file"):
        document = yaml.safe_load(Path(file).read_text("utf-8")) or {}
        nested = document.get("/**", document)
        given = {**nested.get("ros__parameters", nested), **given}
    options = replace(Options(), **{name: _value(name, text) for name, text in given.items()})
    if unknown := set(filter(None, options.fault.split(","))) - FAULTS.keys():
        raise SystemExit(f"fault {', '.join(sorted(unknown))}: not one of {', '.join(FAULTS)}")
    return options


def _value(name, text):
    kinds = {field.name: type(field.default) for field in fields(Options)}
    if name not in kinds:
        raise SystemExit(f"{name}: not one of {', '.join(kinds)}")
    if kinds[name] is bool:
        return str(text).lower() in {"true", "1", "yes"}
    return kinds[name](text)


def count_start(file):
    """Which start of the process this is, from 1, counted in a file."""
    path = Path(file)
    count = int(path.read_text("utf-8")) + 1 if path.exists() else 1
    path.write_text(str(count), "utf-8")
    return count
