"""The code blocks of a tutorial: the files its readers write, the commands they run."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

_BLOCK: Final = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class File:
    """A file that readers write."""

    name: str
    text: str


@dataclass(frozen=True)
class Command:
    """A command that readers run, and what the tutorial says it answers."""

    words: tuple[str, ...]
    answer: str


def steps_of(page: Path) -> Iterator[File | Command]:
    """Yield what a reader does, in order."""
    for language, title, text in _BLOCK.findall(page.read_text(encoding="utf-8")):
        if title:
            yield File(title, text)
        elif language == "console":
            for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
                command, _, answer = part.partition("\n")
                yield Command(tuple(command.split()), answer)
