"""Placeholders in the start command of a stack: ``{map}``, ``{start.x}``, the names of files.

A value is one word to the shell, whatever it contains. Literal braces, also those of the shell,
are doubled.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from grammars.model.geometry import Pose2
from grammars.text.diagnostics import did_you_mean

MAP: Final = "map"
STANDARD: Final = (
    MAP,
    "start.x",
    "start.y",
    "start.yaw",
    "domain",
    "namespace",
    "robot.name",
    "seed",
)
"""Placeholders of every run; ``map`` only if the map is a file."""
DOUBLED: Final = "write {{ and }} for literal braces"
_PART: Final = re.compile(
    r"\{\{|\}\}|\{(?P<name>[A-Za-z0-9][A-Za-z0-9_.-]*)\}|[{}]|[^{}]+", re.DOTALL
)


class PlaceholderError(ValueError):
    """Failure to fill a text: ``message`` is the reason, ``hint`` the remedy.

    ``name`` is the placeholder without a value, empty for braces that are not a placeholder.
    """

    def __init__(self, message: str, hint: str, name: str = "") -> None:
        self.message, self.hint, self.name = message, hint, name
        super().__init__(f"{message}: {hint}")


def fill(text: str, values: Mapping[str, str], *, quoted: bool = True) -> str:
    """Return ``text`` with placeholders replaced, each value as one word of a shell.

    Without ``quoted`` values are unchanged, for texts that no shell reads. Raises
    :class:`PlaceholderError`.
    """
    parts = []
    for plain, name in _parts(text):
        if not name:
            parts.append(plain)
        elif name not in values:
            raise _unknown(name, values)
        else:
            parts.append(shlex.quote(values[name]) if quoted else values[name])
    return "".join(parts)


def placeholders_in(text: str) -> tuple[str, ...]:
    """Return the placeholders of a text, each once; raises :class:`PlaceholderError`."""
    return tuple(dict.fromkeys(name for _, name in _parts(text) if name))


def check_placeholders(text: str, names: Iterable[str]) -> Iterator[PlaceholderError]:
    """Yield the problems of a text that has values for ``names`` only."""
    offered = frozenset(names)
    try:
        placeholders = placeholders_in(text)
    except PlaceholderError as error:
        yield error
        return
    yield from (_unknown(name, offered) for name in placeholders if name not in offered)


def run_values(
    *, start: Pose2, robot: str, namespace: str, seed: int, files: Mapping[str, str]
) -> dict[str, str]:
    """Return the values of a run that do not depend on the folder and domain of its stack.

    ``map`` (a path) and ``domain`` come later. The ``namespace`` has no leading slash, as launch
    files expect.
    """
    x, y, yaw = (repr(float(value)) for value in (start.x, start.y, start.yaw))
    return {
        **files,
        "start.x": x,
        "start.y": y,
        "start.yaw": yaw,
        "namespace": namespace.strip("/"),
        "robot.name": robot,
        "seed": str(seed),
    }


def _parts(text: str) -> Iterator[tuple[str, str]]:
    """Yield plain text and names of placeholders, one of them empty."""
    for part in _PART.finditer(text):
        token = part[0]
        if part["name"]:
            yield "", part["name"]
        elif token in ("{{", "}}"):
            yield token[0], ""
        elif token in ("{", "}"):
            raise PlaceholderError(f'"{token}" does not belong to a placeholder', DOUBLED)
        else:
            yield token, ""


def _unknown(name: str, offered: Iterable[str]) -> PlaceholderError:
    return PlaceholderError(
        f'no placeholder "{name}"', f"{did_you_mean(name, offered)}; {DOUBLED}", name
    )
