"""``python -m daemon worker`` that no hint reaches: of work, or of runs that are not wanted."""

import sys

from daemon.__main__ import main
from daemon.batch.worker import _work

if __name__ == "__main__":
    _work.WORK = "scenario/v1/unheard"
    sys.exit(main())
