"""A stand-in for ``daemon.run`` that leaves a real, small MCAP trace.

The parameters of the system under test say how long it takes (``sleep`` [s]), how much of what
does not compress the trace holds (``ballast`` [bytes]), how much it prints (``chatter`` [bytes]),
how large the result is (``evidence`` [bytes]) and where it notes that it begins and ends (``log``,
a file read by :mod:`tests.chaos.executions`). It goes on until there is a file ``until``; while
there is a file ``quota`` it finds none left. With ``tree`` it leaves a tree of processes, whose
numbers are in that file, and then ends as ``ending`` says. Same specification, same bytes.
"""

import errno
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

from mcap.writer import CompressionType, Writer

from daemon.model.spec import TraceInfo
from tests.chaos.executions import note
from tests.make import make_result

MESSAGES = 20
TREE = 4
"""Processes of a tree."""


def execute(spec, scene, *, trace_path, on_progress=None, interest=None):
    asked = spec.sut.parameters
    log = asked.get("log", "")
    note(log, "begin", spec)
    if "chatter" in asked:
        _chatter(asked["chatter"])
        note(log, "said", spec)
    if "tree" in asked:
        _leave_tree(Path(asked["tree"]))
    time.sleep(asked.get("sleep", 0.0))
    while "until" in asked and not Path(asked["until"]).exists():
        time.sleep(0.05)
    _end_badly(asked.get("ending", ""))
    if "quota" in asked and Path(asked["quota"]).exists():
        raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT), str(trace_path))
    _record(trace_path, spec.digest, asked.get("ballast", 0))
    data = trace_path.read_bytes()
    trace = TraceInfo(hashlib.sha256(data).hexdigest(), len(data), MESSAGES)
    note(log, "end", spec)
    result = make_result(spec, trace=trace)
    if "evidence" in asked:
        verdicts = (replace(result.verdicts[0], text="x" * asked["evidence"]),)
        result = replace(result, verdicts=verdicts)
    return result


def _chatter(size):
    """Print that many bytes, as a program under test does that reports every step."""
    line = "step after step, and a word about each of them\n"
    for _ in range(size // len(line)):
        print(line, end="")
    sys.stdout.flush()


def _leave_tree(pids):
    """Start what starts more, as a system under test that daemonises; wait until all are there."""
    program = Path(__file__).parent / "programs" / "tree.py"
    subprocess.Popen([sys.executable, "-I", "-S", str(program), str(pids)])
    while not pids.exists() or len(pids.read_text().splitlines()) < TREE:
        time.sleep(0.02)


def _end_badly(ending):
    if ending == "crash":
        os.kill(os.getpid(), signal.SIGKILL)
    if ending == "raise":
        raise RuntimeError("as told")


def _record(path, digest, ballast):
    noise = random.Random(digest)
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="", library="chaos")
        schema = writer.register_schema("Step", "jsonschema", b"{}")
        channel = writer.register_channel("/step", "json", schema)
        for step in range(MESSAGES):
            text = {"run": digest, "step": step, "noise": noise.randbytes(ballast // 40).hex()}
            at = step * 50_000_000
            writer.add_message(channel, at, json.dumps(text).encode(), at)
        writer.finish()
