"""The clipboard, where the terminal's own way to it (OSC 52) is barred."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping
from typing import Final

_PATIENCE: Final = 2.0


def into_tmux(text: str, environ: Mapping[str, str] = os.environ) -> bool:
    """Put ``text`` into the buffer of the tmux around us, which passes it on to its terminal.

    As it comes, tmux ignores programs inside of it that ask for that themselves. Returns whether
    there was a tmux that took it.
    """
    if not environ.get("TMUX") or shutil.which("tmux") is None:
        return False
    try:
        done = subprocess.run(
            ["tmux", "load-buffer", "-w", "-"],
            input=text.encode(),
            capture_output=True,
            check=False,
            timeout=_PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0
