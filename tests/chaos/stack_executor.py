"""A run that starts a stack and a relay of its own, and does nothing with them for a while.

The stack is a program that listens, ignores SIGINT now and then, and leaves a part of itself in
another session. Same specification, same bytes, whatever becomes of the stack.
"""

import socket
import sys
import time
from pathlib import Path

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.process import StackProcess
from daemon.stacks.ros2.settings import Ros2Settings
from tests.chaos import executor

PROGRAMS = Path(__file__).parent / "programs"
GRACE = 0.5


def execute(spec, scene, *, trace_path, on_progress=None, interest=None):
    settings = Ros2Settings(
        launch=f"{sys.executable} {PROGRAMS / 'stack.py'} {spec.seed}",
        python=sys.executable,
    )
    stack = StackProcess(
        settings,
        values={},
        relay=PROGRAMS / "relay.py",
        grace=GRACE,
    )
    try:
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(stack.socket))
            listener.listen()
            stack.start()
            end = time.monotonic() + spec.sut.parameters["sleep"]
            while time.monotonic() < end and not stack.ended():
                time.sleep(0.02)
        alive = not stack.ended()
    except SutFailure:
        alive = False  # its supervisor was killed before it had started anything
    finally:
        stack.release()
    trace_path.with_name("alive").write_text(str(alive))
    return executor.execute(spec, scene, trace_path=trace_path)
