"""Campaign files near a folder, those changed last first."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

_DEPTH: Final = 6
_LOOKED_AT: Final = 20_000
"""Most directory entries to look at, so that a search from `/` ends."""
_MOST: Final = 500
"""Files returned at most."""
_HEAD: Final = 65_536
"""Bytes of a file to search for a key, instead of loading the file."""
_PASSED: Final = frozenset(
    {"node_modules", "site-packages", "__pycache__", "build", "dist", "scenario-results", "venv"}
)


def is_campaign(path: Path) -> bool:
    """Return True if a YAML file describes a campaign."""
    return has_key(path, "campaign")


def has_key(path: Path, key: str) -> bool:
    """Return True if a YAML file has ``key`` at its outermost level."""
    if path.suffix not in (".yaml", ".yml"):
        return False
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError:
        return False
    return re.search(rb"^%s\s*:" % key.encode(), head, re.MULTILINE) is not None


def find_campaigns(folder: Path) -> tuple[Path, ...]:
    """Return the campaign files in and below a folder, the latest change first.

    Hidden folders and those of builds and downloads are skipped.
    """
    # People submit the file that they have just written.
    files = [(-entry.stat().st_mtime, Path(entry.path)) for entry in _walk(folder)]
    return tuple(path for _, path in sorted(files))


def _walk(folder: Path) -> Iterator[os.DirEntry[str]]:
    # Breadth first: limits cut far files, not near ones.
    folders, looked, yielded = [(str(folder), 0)], 0, 0
    for place, depth in folders:
        for entry in _entries(place):
            looked += 1
            if looked > _LOOKED_AT or yielded >= _MOST:
                return
            if entry.is_dir(follow_symlinks=False):
                if depth < _DEPTH and entry.name[0] != "." and entry.name not in _PASSED:
                    folders.append((entry.path, depth + 1))
            elif is_campaign(Path(entry.path)) and entry.is_file():
                yielded += 1
                yield entry


def _entries(place: str) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(place) as entries:
            return sorted(entries, key=lambda entry: entry.name)
    except OSError:
        return []


def relative_name(path: Path, here: Path) -> str:
    """Return a path as people would type it from ``here``."""
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


def fuzzy_matches(names: tuple[str, ...], typed: str) -> tuple[str, ...]:
    """Return the names with the typed letters in order, the best match first."""
    if not typed:
        return names
    # Imported here, because the functions above answer TAB and must be fast.
    from textual.fuzzy import FuzzySearch

    search = FuzzySearch()
    scored = [(search.match(typed, name)[0], name) for name in names]
    best = sorted((pair for pair in scored if pair[0] > 0), key=lambda pair: -pair[0])
    return tuple(name for _, name in best)
