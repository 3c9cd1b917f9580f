"""Systems under test that misbehave, each in one way, half a second after their run began.

A table of small functions: what a deed returns is what the system answers. Processes and files that
deeds leave are found by the environment and the folder of the run.
"""

import contextlib
import ctypes
import gc
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


def behave():
    pass


def print_megabytes():
    print("x" * 20_000_000)


def leave():
    os._exit(0)


def leave_badly():
    os._exit(77)


def raise_exit():
    raise SystemExit(0)


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
            loop()
        except BaseException:
            continue


def ignore_signals():
    for number in set(signal.Signals) - {signal.SIGKILL, signal.SIGSTOP}:
        with contextlib.suppress(OSError):
            signal.signal(number, signal.SIG_IGN)
    loop()


def stop_timer():
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    loop()


def sleep():
    time.sleep(1e6)


def take_memory():
    taken = []
    while True:
        taken.append(bytearray(50_000_000))


def recurse():
    recurse()


def recurse_for_good():
    sys.setrecursionlimit(10**9)
    recurse()


def touch_nothing():
    ctypes.string_at(0)


def abort():
    os.abort()


def kill_itself():
    os.kill(os.getpid(), signal.SIGKILL)


def stop_itself():
    os.kill(os.getpid(), signal.SIGSTOP)


def signal_group():
    os.killpg(0, signal.SIGTERM)


def close_descriptors():
    os.closerange(0, 1024)


def open_descriptors():
    opened = []
    while True:
        opened.append(os.open("/dev/null", os.O_RDONLY))


def replace_stdout():
    sys.stdout = sys.stderr = None


def read_stdin():
    sys.stdin.read()


def go_elsewhere():
    os.chdir("/")
    os.umask(0o777)


def close_folder():
    own_folder().chmod(0)


def make_immutable():
    (own_folder() / "kept").touch()
    subprocess.run(["chattr", "+i", str(own_folder() / "kept")], check=False, capture_output=True)


def leave_pipes():
    for name in ("result.json", "judged.json.z", "watched", "pipe"):
        with contextlib.suppress(FileExistsError):
            os.mkfifo(own_folder() / name)


def leave_links():
    for name, target in (("loop", "loop"), ("root", "/"), ("result.json", "/dev/zero")):
        with contextlib.suppress(FileExistsError):
            (own_folder() / name).symlink_to(target)


def remove_folder():
    shutil.rmtree(own_folder())


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
            time.sleep(1e6)


def collect_nothing():
    gc.disable()
    gc.freeze()


def lower_limits():
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))


def command_nan():
    return Decision(Twist2(float("nan")), Progress(0, 0, "active"))


def command_much():
    return Decision(Twist2(1e300, -1e300, 1e300), Progress(0, 0, "active"))


def answer_nonsense():
    return "drive"


def complain_about_numbers():
    np.seterr(all="raise")


DEEDS = {
    deed.__name__: deed
    for deed in (
        behave, print_megabytes, leave, leave_badly, raise_exit, raise_interrupt, raise_anything,
        loop, swallow_everything, ignore_signals, stop_timer, sleep, take_memory, recurse,
        recurse_for_good, touch_nothing, abort, kill_itself, stop_itself, signal_group,
        close_descriptors, open_descriptors, replace_stdout, read_stdin, go_elsewhere,
        close_folder, make_immutable, leave_pipes, leave_links, remove_folder, leave_threads,
        leave_children, daemonise, fork_much, collect_nothing, lower_limits, command_nan,
        command_much, answer_nonsense, complain_about_numbers,
    )
}  # fmt: skip


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
        return Decision(Twist2(), Progress(0, 0, "active"))
