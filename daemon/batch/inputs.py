"""What runs need and share: scenes and files of systems under test, each named by its digest."""

from __future__ import annotations

import os
from pathlib import Path

from daemon.batch.stores import file_sha256
from grammars.model.scene import Scene
from grammars.text import codec
from grammars.text.files import write_atomically


def is_intact(path: Path) -> bool:
    """Whether a scene or file is there that is what its name says; raises ``OSError`` when it is
    there and cannot be read.
    """
    try:
        return file_sha256(path) == path.stem
    except FileNotFoundError:
        return False


def keep_scene(path: Path, scene: Scene) -> None:
    """Store a scene under its name, in place of a damaged one too; raises ``OSError``."""
    if is_intact(path):
        os.utime(path)  # a campaign on its way needs it: it is no stray for now
    else:
        write_atomically(path, codec.to_json(scene))
