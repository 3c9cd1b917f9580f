"""What runs need and share: scenes and files of systems under test, each named by its digest."""

from __future__ import annotations

import os
from pathlib import Path

from daemon.batch.stores import file_sha256
from grammars.model.scene import Scene
from grammars.text import codec
from grammars.text.files import write_atomically


def verify_scene(path: Path) -> bool:
    """Whether the scene of that name (``<digest>.json``) is there, undamaged; raises ``OSError``
    when it is there and cannot be read.
    """
    try:
        return file_sha256(path) == path.stem
    except FileNotFoundError:
        return False


def verify_file(path: Path) -> bool:
    """Whether the file of that name, a digest, is there, undamaged; raises ``OSError``
    when it is there and cannot be read.
    """
    try:
        return file_sha256(path) == path.name
    except FileNotFoundError:
        return False


def keep_scene(path: Path, scene: Scene) -> None:
    """Store a scene under its name, in place of a damaged one too; raises ``OSError``."""
    if verify_scene(path):
        os.utime(path)  # a campaign on its way needs it: it is no stray for now
    else:
        write_atomically(path, codec.to_json(scene))
