"""Systems under test that misbehave, each in one way, half a second after their run began.

A table of deeds: what a deed returns is what the system answers. Processes and files that deeds
leave are found by the environment and the folder of the run.
"""

import contextlib
import ctypes
import gc
import inspect
import os
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np

from scenario_tui.sut import Decision, Progress, Twist2

SLEEPER = [sys.executable, "-I", "-S", "-c", "import time; time.sleep(1000)"]


def own_folder():
    """The folder of the attempt: that of the trace which this process writes."""
    links = [link for link in Path("/proc/self/fd").iterdir() if link.is_symlink()]
    return next(link.readlink().parent for link in links if link.readlink().suffix == ".partial")


def sleep():
    time.sleep(1e6)


class Deeds:
    """What takes more than an expression."""

    def raise_interrupt():
        raise KeyboardInterrupt

    def raise_anything():
        raise BaseException("neither an error nor an exit")

    def loop():
        while True:
            pass

    def swallow_everything():
        while True:
            try:
                Deeds.loop()
            except BaseException:
                continue

    def ignore_signals():
        for number in set(signal.Signals) - {signal.SIGKILL, signal.SIGSTOP}:
            with contextlib.suppress(OSError):
                signal.signal(number, signal.SIG_IGN)
        Deeds.loop()

    def stop_timer():
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        Deeds.loop()

    def take_memory():
        taken = []
        while True:
            taken.append(bytearray(50_000_000))

    def recurse():
        Deeds.recurse()

    def recurse_for_good():
        sys.setrecursionlimit(10**9)
        Deeds.recurse()

    def open_descriptors():
        opened = []
        while True:
            opened.append(os.open("/dev/null", os.O_RDONLY))

    def replace_stdout():
        sys.stdout = sys.stderr = None

    def go_elsewhere():
        os.chdir("/")
        os.umask(0o777)

    def make_immutable():
        kept = own_folder() / "kept"
        kept.touch()
        subprocess.run(["chattr", "+i", str(kept)], check=False, capture_output=True)

    def leave_pipes():
        for name in ("result.json", "judged.json.z", "watched", "pipe"):
            with contextlib.suppress(FileExistsError):
                os.mkfifo(own_folder() / name)

    def leave_links():
        for name, target in (("loop", "loop"), ("root", "/"), ("result.json", "/dev/zero")):
            with contextlib.suppress(FileExistsError):
                (own_folder() / name).symlink_to(target)

    def leave_threads():
        for _ in range(20):
            threading.Thread(target=sleep).start()

    def leave_children():
        for _ in range(5):
            subprocess.Popen(SLEEPER, start_new_session=True)

    def daemonise():
        if not os.fork():
            os.setsid()
            if os.fork():
                os._exit(0)
            os.execv(SLEEPER[0], SLEEPER)

    def fork_much():
        for _ in range(200):
            if not os.fork():
                sleep()

    def collect_nothing():
        gc.disable()
        gc.freeze()

    def lower_limits():
        resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    def complain_about_numbers():
        np.seterr(all="raise")


ACTIVE = Progress(0, 0, "active")
DEEDS = {
    "behave": lambda: None,
    "print_megabytes": lambda: print("x" * 20_000_000),
    "leave": lambda: os._exit(0),
    "leave_badly": lambda: os._exit(77),
    "raise_exit": lambda: sys.exit(0),
    "sleep": sleep,
    "touch_nothing": lambda: ctypes.string_at(0),
    "abort": os.abort,
    "kill_itself": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "stop_itself": lambda: os.kill(os.getpid(), signal.SIGSTOP),
    "signal_group": lambda: os.killpg(0, signal.SIGTERM),
    "close_descriptors": lambda: os.closerange(0, 1024),
    "read_stdin": lambda: sys.stdin.read() and None,
    "close_folder": lambda: own_folder().chmod(0),
    "remove_folder": lambda: shutil.rmtree(own_folder()),
    "command_nan": lambda: Decision(Twist2(float("nan")), ACTIVE),
    "command_much": lambda: Decision(Twist2(1e300, -1e300, 1e300), ACTIVE),
    "answer_nonsense": lambda: "drive",
    **dict(inspect.getmembers(Deeds, inspect.isfunction)),
}


class Hostile:
    """Stands still, but for its deed."""

    period = 0.1
    needs_ground_truth = False

    def __init__(self, parameters):
        self.deed = DEEDS[parameters["deed"]]

    def start(self, briefing):
        pass

    def update(self, observation):
        if self.deed is not None and observation.time >= 0.5:
            deed, self.deed = self.deed, None
            answer = deed()
            if answer is not None:
                return answer
        return Decision(Twist2(), ACTIVE)
