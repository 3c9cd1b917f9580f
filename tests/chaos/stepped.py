"""``python -m tests.chaos.stepped serve ORDER``: a daemon whose wall clock can be set.

The file ``offset`` beside the state directory holds the seconds by which the clock is off; it is
read whenever the time is asked for.
"""

import json
import sys
import time
from pathlib import Path

from daemon.__main__ import main


def _set_clock(file):
    true = time.time

    def wall():
        return true() + (float(file.read_text()) if file.exists() else 0.0)

    time.time = wall


if __name__ == "__main__":
    _set_clock(Path(json.loads(sys.argv[2])["state"]).parent / "offset")
    sys.exit(main())
