"""A program that leaves processes in its own group, in a session of their own, and deaf to SIGTERM.

``python tree.py PIDS``: each of the four notes its number in that file.
"""

import os
import signal
import sys
import time
from pathlib import Path


def _stay():
    with Path(sys.argv[1]).open("a", encoding="ascii") as file:
        file.write(f"{os.getpid()}\n")
    time.sleep(600.0)


if os.fork() == 0:
    _stay()  # a child as usual
elif os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        if os.fork() == 0:
            _stay()  # its parent is gone in a moment: nobody's child
        os._exit(0)
    _stay()
else:
    _stay()
