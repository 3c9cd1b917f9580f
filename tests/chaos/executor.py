"""A stand-in for ``daemon.run`` that leaves a real, small MCAP trace.

The parameters of the system under test say how long it takes (``sleep`` [s]), how much of what
does not compress the trace holds (``ballast`` [bytes]), how much it prints (``chatter`` [bytes]),
how large the result is (``evidence`` [bytes]) and where it notes that it begins and ends (``log``,
a file read by :class:`Executions`). It goes on until there is a file ``until``. With ``stack`` it
starts a stack and a relay of its own for so many seconds, and does nothing with them. Same
specification, same bytes.
"""

import hashlib
import json
import os
import random
import socket
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

from mcap.writer import CompressionType, Writer

from daemon.model.spec import TraceInfo
from tests.make import make_result

EXECUTOR = f"{__name__}:execute"
PROGRAMS = Path(__file__).parent / "programs"
MESSAGES = 20
GRACE = 0.5


def execute(spec, scene, *, trace_path, on_progress=None, interest=None):
    asked = spec.sut.parameters
    log = asked.get("log", "")
    _note(log, "begin", spec)
    if "chatter" in asked:
        _chatter(asked["chatter"])
    if "stack" in asked:
        _start_stack(spec.seed, asked["stack"])
    time.sleep(asked.get("sleep", 0.0))
    while "until" in asked and not Path(asked["until"]).exists():
        time.sleep(0.05)
    _record(trace_path, spec.digest, asked.get("ballast", 0))
    data = trace_path.read_bytes()
    trace = TraceInfo(hashlib.sha256(data).hexdigest(), len(data), MESSAGES)
    _note(log, "end", spec)
    result = make_result(spec, trace=trace)
    if "evidence" in asked:
        verdicts = (replace(result.verdicts[0], text="x" * asked["evidence"]),)
        result = replace(result, verdicts=verdicts)
    return result


def _note(log, what, spec):
    """Append a line to the file ``log``, if there is one; whole also when many write."""
    if log:
        file = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        os.write(file, f"{what} {spec.digest} {os.getpid()}\n".encode())
        os.close(file)


class Executions:
    """The file in which executions note that they begin and end."""

    def __init__(self, path):
        self.path = path

    @property
    def begun(self):
        """How often each run was begun, by the digest of its specification."""
        return self.counted("begin")

    @property
    def started_over(self):
        """Executions beyond the first one of each run."""
        return self.begun.total() - len(self.begun)

    def counted(self, what):
        """How often each run began (``begin``) or ended (``end``)."""
        if not self.path.exists():
            return Counter()
        words = (line.split() for line in self.path.read_text().splitlines())
        return Counter(digest for kind, digest, _ in words if kind == what)


def _chatter(size):
    """Print that many bytes, as a program under test does that reports every step."""
    line = "step after step, and a word about each of them\n"
    for _ in range(size // len(line)):
        print(line, end="")
    sys.stdout.flush()


def _start_stack(seed, seconds):
    """Start a stack that listens, ignores SIGINT now and then, and leaves a part of itself."""
    # Not for each process that executes runs.
    from daemon.model.sut import SutFailure
    from daemon.stacks.ros2.process import StackProcess
    from daemon.stacks.ros2.settings import Ros2Settings

    launch = f"{sys.executable} {PROGRAMS / 'stack.py'} {seed}"
    settings = Ros2Settings(launch=launch, python=sys.executable)
    stack = StackProcess(settings, values={}, relay=PROGRAMS / "relay.py", grace=GRACE)
    try:
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(stack.socket))
            listener.listen()
            stack.start()
            end = time.monotonic() + seconds
            while time.monotonic() < end and not stack.ended():
                time.sleep(0.02)
    except SutFailure:
        pass  # its supervisor was killed before it had started anything
    finally:
        stack.release()


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
