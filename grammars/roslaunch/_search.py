"""Launch files near another one that start a node of some package."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

_ENDINGS: Final = (".launch", ".launch.xml", ".xml")
_MOST_FILES: Final = 500
_LARGEST: Final = 2**20


def launch_files_starting(package: str, around: Path) -> list[Path]:
    """Return the launch files that start a node of ``package``, in the package of ``around``.

    Where that is part of no package its folder is looked through. The paths are absolute.

    They are only searched for the name, not read: what they need to be read is not known.
    """
    beside = around.absolute().parent
    packages = (one for one in around.absolute().parents if (one / "package.xml").is_file())
    top = next(packages, None)
    wanted = re.compile(rf"<node\b[^>]*\bpkg\s*=\s*[\"']{re.escape(package)}[\"']")
    return sorted(
        path for path in _launch_files(top or beside, top is not None) if wanted.search(_text(path))
    )


def _launch_files(top: Path, deep: bool) -> Iterator[Path]:
    count = 0
    for folder, below, names in os.walk(top):
        below[:] = sorted(name for name in below if deep and not name.startswith("."))
        for name in names:
            if name.endswith(_ENDINGS) and name != "package.xml":
                count += 1
                if count > _MOST_FILES:
                    return
                yield Path(folder) / name


def _text(path: Path) -> str:
    """Return the text of a file without comments; empty if it is none of people's."""
    try:
        if not path.is_file() or path.stat().st_size > _LARGEST:
            return ""
        return re.sub(r"<!--.*?-->", "", path.read_text("utf-8", errors="replace"), flags=re.DOTALL)
    except OSError:
        return ""
