"""Cause of a failure from the output of a stack: one sentence that names file and node.

Texts are those of launch, rclcpp, rclcpp_lifecycle, rcl_yaml_param_parser, pluginlib,
class_loader, BehaviorTree.CPP and Nav2 from Humble to Kilted. An unknown text is quoted.
"""

from __future__ import annotations

import re
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import getitem
from typing import Any, Final

from grammars.text.diagnostics import InputError, closest
from grammars.text.documents import paths_inside, read_text
from grammars.text.ros_yaml import load_ros_yaml

DIED: Final = "process has died"
ABORTED: Final = "Failed to bring up all requested nodes"
DOWN: Final = "CRITICAL FAILURE: SERVER"
ALARMS: Final = (DIED, ABORTED, DOWN)
"""Parts of the lines that report a damaged stack."""

_LINE: Final = re.compile(
    r"(?:\[(?P<process>[^\[\]]+)-\d+\] )?"
    r"(?:\[(?P<level>[A-Z]+)\] (?:\[[\d.]+\] )?\[(?P<logger>[^\]]*)\]:? ?)?(?P<text>.*)"
)
"""``[process-3] [ERROR] [1712.5] [logger]: text``: launch writes the process, rcutils the rest.
Launch's own lines have no time, and the process in the place of the logger."""
_DEATH: Final = re.compile(
    r"\[(?P<process>[^\[\]]+)-\d+\]: process has died "
    r"\[pid \d+, exit code (?P<code>-?\d+)(?:, cmd '(?P<command>.*)')?"
)
_SERVER: Final = re.compile(r"SERVER (?P<node>\S+) IS DOWN")
_LIBRARIES: Final = ("rcl", "rclcpp", "rclcpp_lifecycle", "launch")
"""Loggers without the name of a node."""
_CONTAINER: Final = "component_container"
"""Prefix of executables that hold several nodes."""
_ERRORS: Final = ("ERROR", "FATAL")
_EXCEPTION: Final = "what(): "
_CONSEQUENCES: Final = (
    "Failed to change state for node",
    ABORTED,
    DIED,
    "Caught exception in callback for transition",
    "does not have error state implemented",
    "Failed to parse global arguments",
)
"""Texts that follow from an earlier error; the first may also be a late answer."""
_MOST_LINES: Final = 20
_PARAMETERS: Final = "ros__parameters"
_ALL_NODES: Final = "**"

_WRONG_TYPE: Final = re.compile(
    r"parameter '(?P<name>[^']+)' has invalid type: (?:Wrong parameter type, parameter \{.*?\} is "
    r"of type \{(?P<type>[^}]+)\}, setting it to \{(?P<actual>[^}]+)\}"
    r"|expected \[(?P<old_type>\w+)\] got \[(?P<old_actual>\w+)\])"
)
_NO_PLUGIN: Final = re.compile(
    r"According to the loaded plugin descriptions the class (?P<class>\S+) with base class type "
    r"(?P<base>\S+) does not exist\.(?: Declared types are\s*(?P<declared>.*))?"
)
_NO_LIBRARY: Final = re.compile(
    r"Could not load library:? (?:dlopen error: )?(?P<library>[^\s:,]+)(?:: (?P<why>[^,]+))?"
)
_NO_FILE: Final = re.compile(
    r"Couldn't parse params file: '--params-file (?P<file>[^']*)'\. Error: (?P<why>.+)"
)
_AT_LINE: Final = re.compile(r" ?\b(?:at|near) line (?P<line>\d+)")
_SOURCE: Final = re.compile(r",? at \S+\.c(?:pp)?:\d+.*")
_LAUNCH_YAML: Final = re.compile(r'in "(?P<file>[^"]+)", line (?P<line>\d+), column \d+')


@dataclass(frozen=True, slots=True)
class _Line:
    """A printed line: the name of its process and node (empty if unknown), level, and text."""

    process: str
    node: str
    level: str
    text: str

    @property
    def is_error(self) -> bool:
        """True for an error, or an exception that ended a process."""
        return self.level in _ERRORS or self.text.lstrip().startswith(_EXCEPTION)


@dataclass(frozen=True, slots=True)
class ProcessDeath:
    """Death of a process of launch by an error.

    ``process`` is the name of its executable, ``command`` its command line if launch prints it.
    """

    process: str
    code: int
    command: str

    def is_of(self, nodes: Sequence[str]) -> bool:
        """Tell whether one of the nodes, by absolute names, may have lived in it."""
        names = {node.rpartition("/")[2] for node in nodes}
        renamed = re.findall(r"__node:=(\S+)", self.command)
        return (
            not names
            or self.process in names
            or not names.isdisjoint(renamed)
            or self.process.startswith(_CONTAINER)
        )

    def __str__(self) -> str:
        name = next((f" ({one.name})" for one in signal.Signals if one == -self.code), "")
        return f"{self.process} died with exit code {self.code}{name}"


def read_death(line: str) -> ProcessDeath | None:
    """Return the death that a line of launch reports, ``None`` without one."""
    match = _DEATH.search(line)
    if match is None:
        return None
    return ProcessDeath(match["process"], int(match["code"]), match["command"] or "")


def read_down(line: str) -> str:
    """Return the node whose heartbeat Nav2's lifecycle manager misses, empty without one."""
    match = _SERVER.search(line)
    return match["node"] if match else ""


def find_cause(printed: Sequence[str], files: Mapping[str, str]) -> str:
    """Return the first known cause in the printed lines as a sentence; empty without one.

    ``files`` are the paths of the user's parameter files by their name in the SUT file.
    """
    lines = [_read(line) for line in printed]
    for index, line in enumerate(lines):
        for pattern, explain in _KINDS:
            match = pattern.search(line.text)
            if match is not None and line.level in ("", *_ERRORS):
                return explain(match, line, files)
        if line.is_error and (place := _launch_yaml(lines[index:])):
            return _about_file(files, place[0], place[1], f"launch cannot read it: {place[2]}")
    return ""


def first_error(printed: Sequence[str]) -> str:
    """Return the first error that does not follow from another, with its node; or empty."""
    errors = [line for line in map(_read, printed) if line.is_error]
    for consequences in (_CONSEQUENCES, _CONSEQUENCES[1:]):
        for line in errors:
            if not any(words in line.text for words in consequences):
                text = line.text.strip().removeprefix(_EXCEPTION).strip()
                return f"{line.node or line.process}: {text}".removeprefix(": ")
    return ""


def telling_lines(printed: Sequence[str]) -> tuple[str, ...]:
    """Return the lines with errors and the last lines, each once, in their order."""
    count = len(printed)
    errors = [i for i, line in enumerate(printed) if DIED in line or _read(line).is_error]
    indices = {*errors[:_MOST_LINES], *range(max(0, count - _MOST_LINES), count)}
    return tuple(printed[index] for index in sorted(indices))


def _read(line: str) -> _Line:
    match = _LINE.match(line)
    assert match is not None  # every part is optional
    process, logger = match["process"] or "", match["logger"] or ""
    parts = logger.split(".")
    node = "" if logger in _LIBRARIES else parts[-1]
    # Plug-ins log below the name of their node.
    if process in parts or (not node and not process.startswith(_CONTAINER)):
        node = process
    return _Line(process, node, match["level"] or "", match["text"])


# Causes, each with its sentence


def _wrong_type(match: re.Match[str], line: _Line, files: Mapping[str, str]) -> str:
    name = match["name"]
    needed, actual = match["type"] or match["old_type"], match["actual"] or match["old_actual"]
    place, value = _find_value(files, line.node, lambda path, _: ".".join(map(str, path)) == name)
    literal = f'"{value}"' if isinstance(value, str) else str(value)
    what = f"{literal} is {_a(actual)}" if place else f"got {_a(actual)}"
    return f"{place}{line.node or 'a node'} needs {_a(needed)} for {name}, and {what}"


def _a(kind: str) -> str:
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def _no_plugin(match: re.Match[str], line: _Line, files: Mapping[str, str]) -> str:
    plugin = match["class"]
    place, _ = _find_value(files, line.node, lambda _, value: value == plugin)
    close = closest(plugin, (match["declared"] or "").split())
    hint = f'; did you mean "{close}"?' if close else ""
    node = line.node or "a node"
    return f'{place}{node} finds no plug-in "{plugin}" of type {match["base"]}{hint}'


def _no_library(match: re.Match[str], line: _Line, files: Mapping[str, str]) -> str:
    library = match["library"]
    stem = library.rpartition("/")[2].removesuffix(".so").removeprefix("lib")
    place, _ = _find_value(files, line.node, lambda _, value: value in (stem, library))
    why = f": {match['why'].strip()}" if match["why"] else ""
    return f"{place}{line.node or 'a node'} cannot load the library {library}{why}"


def _no_file(match: re.Match[str], line: _Line, files: Mapping[str, str]) -> str:
    why = _SOURCE.sub("", match["why"])
    at = _AT_LINE.search(why)
    why = _AT_LINE.sub("", why).strip()
    what = f"{line.node or 'a node'} cannot read it: {why}"
    return _about_file(files, match["file"], int(at["line"]) if at else 0, what)


_KINDS: Final[tuple[tuple[re.Pattern[str], Callable[..., str]], ...]] = (
    (_WRONG_TYPE, _wrong_type),
    (_NO_PLUGIN, _no_plugin),
    (_NO_LIBRARY, _no_library),
    (_NO_FILE, _no_file),
)


def _launch_yaml(lines: Sequence[_Line]) -> tuple[str, int, str] | None:
    """Return file, line and problem of a YAML error of Python, which takes several lines."""
    problem = ""
    place = None
    for line in lines[1:5]:
        match = _LAUNCH_YAML.search(line.text)
        if match is None:
            problem = line.text.strip() or problem
        else:
            place = match["file"], int(match["line"])
    if place is None or "launch" not in lines[0].text:
        return None
    return (*place, problem)


def _about_file(files: Mapping[str, str], path: str, line: int, what: str) -> str:
    """Return a sentence about a file of the user, or about launch's copy of it."""
    for name, own in files.items():
        if own == path:
            return f"{_place(name, line)}{what}"
    copied = _lines_of(path)[line - 1 : line] if line else []
    for name, own in files.items():
        lines = _lines_of(own)
        # Launch files rewrite parameters, so the line has another number there.
        if copied and lines.count(copied[0]) == 1:
            return f"{_place(name, lines.index(copied[0]) + 1)}{what}"
    return f"{path}{f', line {line}' if line else ''}: {what}"


def _lines_of(path: str) -> list[str]:
    try:
        return [line.strip() for line in read_text(path).splitlines()]
    except (InputError, OSError):
        return []


def _place(name: str, line: int) -> str:
    return f'line {line} of the file "{name}": ' if line else f'the file "{name}": '


def _find_value(
    files: Mapping[str, str], node: str, condition: Callable[[Sequence[Any], Any], bool]
) -> tuple[str, Any]:
    """Return place and value of the parameter that meets ``condition``, or ("", ``None``).

    A parameter of the node takes precedence over one of all nodes, and that over a single match.
    ``condition`` takes the path below ``ros__parameters`` and the value there.
    """
    values = [
        (owner, _place(name, line), value)
        for name, file in files.items()
        for owner, path, value, line in _parameters(file)
        if condition(path, value)
    ]
    for owners in (node, _ALL_NODES):
        for owner, place, value in values:
            if owner == owners:
                return place, value
    return values[0][1:] if len(values) == 1 else ("", None)


def _parameters(file: str) -> Iterator[tuple[str, Sequence[Any], Any, int]]:
    """Yield node, path below it, value and line of each parameter in a ROS parameter file."""
    try:
        document, _ = load_ros_yaml(file)
    except (InputError, OSError):
        return
    for path in paths_inside(document.data):
        if _PARAMETERS in path[1:]:
            at = path.index(_PARAMETERS)
            value = reduce(getitem, path, document.data)
            owner = str(path[at - 1]).rpartition("/")[2]
            yield owner, path[at + 1 :], value, document.where(path).line
