"""``python -m daemon`` on a disk that is full while there is a file ``full`` beside the state."""

import errno
import os
import sys
from pathlib import Path

from daemon.__main__ import main
from daemon.batch.server import _opening
from daemon.batch.stores import write_marker

FULL = Path(sys.argv[sys.argv.index("--state") + 1]).with_name("full")


def _write(paths):
    if FULL.exists():
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(paths.marker))
    return write_marker(paths)


if __name__ == "__main__":
    _opening.write_marker = _write
    sys.exit(main())
