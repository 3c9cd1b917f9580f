"""Settings of a ROS 2 stack: reading, defaults in use, warnings, and placeholders.

Times are seconds, shares fractions, names of topics, actions and nodes absolute. The start command
has placeholders: ``{map}``, ``{start.x}``, the names of files. A value is one word to the shell,
whatever it contains. Literal braces, also those of the shell, are doubled.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, Final

from pydantic import BaseModel, Field, ValidationError

from daemon.model.attachments import FILES_PARAMETER
from daemon.model.sut import Briefing
from daemon.stacks.findings import ParameterError, ParameterFinding, ParameterLocation
from daemon.stacks.ros2.keys import Ros2Keys
from grammars.model.robot import Robot
from grammars.text.diagnostics import did_you_mean
from grammars.text.documents import explain_finding
from grammars.text.quantity import QuantityField

_FILE_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,59}$"
_SHORTEST_START: Final = 15.0
"""Shortest start-up without a warning [s]. The eight lifecycle nodes of Nav2 (Jazzy) were active
12.3 s after "ros2 launch" on an idle machine."""
_ROUNDING: Final = 1e-6

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
_DOUBLED: Final = "write {{ and }} for literal braces"
_PART: Final = re.compile(
    r"\{\{|\}\}|\{(?P<name>[A-Za-z0-9][A-Za-z0-9_.-]*)\}|[{}]|[^{}]+", re.DOTALL
)


class Ros2Settings(Ros2Keys):
    """User's settings of a stack: the keys, and the attached files by name."""

    files: dict[Annotated[str, Field(pattern=_FILE_NAME)], str] = Field(default_factory=dict)


def read_settings(parameters: Mapping[str, Any]) -> Ros2Settings:
    """Return the settings in a tree of parameters: keys as written, and ``repeatable: false``.

    Raises :class:`~daemon.stacks.findings.ParameterError` with all errors.
    """
    keys = {name: value for name, value in parameters.items() if name != "repeatable"}
    problems = []
    if parameters.get("repeatable", False) is not False:
        message = "a stack outside of the simulation is never repeatable"
        problems.append(ParameterFinding(("repeatable",), message, "leave it out"))
    try:
        settings = Ros2Settings.model_validate(keys, context={"namespace": keys.get("namespace")})
    except ValidationError as error:
        raise ParameterError([*problems, *map(_in_words, error.errors())]) from error
    problems += [*_start_problems(settings), *_placeholder_problems(settings)]
    if problems:
        raise ParameterError(problems)
    return settings


def settings_not_written(settings: Ros2Settings) -> dict[str, dict[str, Any]]:
    """Return the defaults in use by section, in the form of a file.

    The section of keys at the top of a file is called ``stack``.
    """
    sections = {"stack": settings, "environment": settings.environment, "topics": settings.topics}
    sections |= {"qos": settings.qos, "frames": settings.frames}
    if settings.container is not None:
        sections["container"] = settings.container
    return {name: dict(_not_written(section)) for name, section in sections.items()}


def _not_written(section: BaseModel) -> Iterator[tuple[str, Any]]:
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if name in section.model_fields_set or isinstance(value, BaseModel):
            continue
        quantity = next((x for x in field.metadata if isinstance(x, QuantityField)), None)
        if quantity is not None:
            value = f"{100.0 * value:g} %" if quantity.dimension == "ratio" else f"{value:g} s"
        yield field.alias or name, value or "none"


def placeholder_names(settings: Ros2Settings) -> tuple[str, ...]:
    """Return the names of placeholders, including files."""
    standard = [name for name in STANDARD if name != MAP or settings.map == "file"]
    return (*standard, *settings.files)


def texts_with_placeholders(settings: Ros2Settings) -> Iterator[tuple[ParameterLocation, str]]:
    """Yield every text with placeholders and its place in the tree."""
    if settings.launch:
        yield ("launch",), settings.launch
    for name, value in settings.environment.variables.items():
        yield ("environment", name), value
    if settings.container is not None:
        yield ("container", "image"), settings.container.image
        for index, option in enumerate(settings.container.options):
            yield ("container", "options", index), option


def fill_settings(settings: Ros2Settings, values: Mapping[str, str]) -> Ros2Settings:
    """Return the settings with placeholders filled; values are quoted only in ``launch``.

    Raises :class:`PlaceholderError` for a missing value.
    """

    def plain(text: str) -> str:
        return fill(text, values, quoted=False)

    container, environment = settings.container, settings.environment
    if container is not None:
        options = tuple(map(plain, container.options))
        container = container.model_copy(
            update={"image": plain(container.image), "options": options}
        )
    variables = {name: plain(text) for name, text in environment.variables.items()}
    filled = {
        "launch": fill(settings.launch, values),
        "environment": environment.model_copy(update=variables),
        "container": container,
    }
    return settings.model_copy(update=filled)


def _in_words(error: Any) -> ParameterFinding:
    path, message, hint = explain_finding(Ros2Settings, error)
    return ParameterFinding(tuple(part for part in path if part != "[key]"), message, hint)


def _start_problems(settings: Ros2Settings) -> Iterator[ParameterFinding]:
    """Yield problems that prevent the start of the stack."""
    if not settings.launch and settings.container is None:
        message = 'key "launch" is missing: the command that starts the stack'
        yield ParameterFinding(("launch",), message, "or name an image below container")
    if settings.container is not None and not settings.container.image:
        message = 'key "image" is missing: the image of the stack'
        yield ParameterFinding(("container", "image"), message)
    for name in settings.files:
        if name in STANDARD:
            message = f'{name}: every run has a placeholder "{name}"'
            yield ParameterFinding((FILES_PARAMETER, name), message, "give the file another name")


def _placeholder_problems(settings: Ros2Settings) -> Iterator[ParameterFinding]:
    names = placeholder_names(settings)
    for path, text in texts_with_placeholders(settings):
        for problem in _check_placeholders(text, names):
            hint = problem.hint
            if problem.name == MAP and settings.map == "published":
                hint = "the map is a topic, not a file: leave it out, or write map: file"
            yield ParameterFinding(path, problem.message, hint)


def warnings_about(settings: Ros2Settings) -> Iterator[ParameterFinding]:
    """Yield the reasons why a stack will start but probably not work."""
    used = {name for _, text in texts_with_placeholders(settings) for name in placeholders_in(text)}
    if settings.start_up < _SHORTEST_START:
        message = f"{settings.start_up:g} s: Nav2 needs 12 s on an idle machine"
        yield ParameterFinding(("start-up",), message, "leave it out for 60 s")
    if not settings.ready:
        message = (
            "ready names no nodes: the mission begins once its action and a subscription to the "
            "scan exist, even if the stack is not active"
        )
        hint = "name the lifecycle nodes, such as [amcl, controller_server, bt_navigator]"
        yield ParameterFinding(("ready",), message, hint)
    if settings.map == "file" and MAP not in used:
        message = "{map} is not used, so the stack does not receive the map of the run"
        hint = 'pass it on, such as map:={map}, or write "map: published"'
        yield ParameterFinding(("launch",), message, hint)
    for name in settings.files:
        if name not in used:
            message = f"{{{name}}} is not used, so the stack does not receive this file"
            yield ParameterFinding((FILES_PARAMETER, name), message, "pass its path on")
    if settings.environment.domain != "own":
        message = "simultaneous runs on one machine share this domain and disturb each other"
        hint = "own gives each run its own domain"
        yield ParameterFinding(("environment", "ROS_DOMAIN_ID"), message, hint)


def advise_for_robot(settings: Ros2Settings, robot: Robot) -> Iterator[ParameterFinding]:
    """Yield settings that do not fit the robot: unknown lasers, a period that misses its rates."""
    yield from _about_lasers(settings, robot)
    sensors = {laser.label: laser.rate for laser in robot.lasers}
    for name, rate in (sensors | {"odometry": robot.odometry.rate}).items():
        if rate <= 0.0:
            continue
        cycles = 1.0 / (rate * settings.period)
        if not (_is_whole(cycles) or _is_whole(1.0 / cycles)):
            message = (
                f"the {name} of robot {robot.name} has {rate:g} Hz, which is not a whole number of "
                f"cycles of {settings.period:g} s: some cycles have a sample more than others"
            )
            hint = "set period to that of the stack's controller, or another rate of the robot"
            yield ParameterFinding(("period",), message, hint)


def _about_lasers(settings: Ros2Settings, robot: Robot) -> Iterator[ParameterFinding]:
    names = [laser.name for laser in robot.lasers]
    has = f"has lasers {', '.join(names)}" if names[0] else "has one laser, which has no name"
    for path, names_by_laser in (
        (("topics", "scan"), settings.topics.scan),
        (("frames", "laser"), settings.frames.laser),
    ):
        for name in () if isinstance(names_by_laser, str) else names_by_laser:
            if name not in names:
                message = f'robot {robot.name} has no laser "{name}": it {has}'
                hint = did_you_mean(name, filter(None, names))
                yield ParameterFinding((*path, name), message, hint)


def _is_whole(ratio: float) -> bool:
    return round(ratio) >= 1 and abs(ratio - round(ratio)) <= _ROUNDING * ratio


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


def _check_placeholders(text: str, names: Iterable[str]) -> Iterator[PlaceholderError]:
    """Yield the problems of a text that has values for ``names`` only."""
    offered = frozenset(names)
    try:
        placeholders = placeholders_in(text)
    except PlaceholderError as error:
        yield error
        return
    yield from (_unknown(name, offered) for name in placeholders if name not in offered)


def run_values(settings: Ros2Settings, briefing: Briefing) -> dict[str, str]:
    """Return the values of a run that do not depend on the folder and domain of its stack.

    ``map`` (a path) and ``domain`` come later. The ``namespace`` has no leading slash, as launch
    files expect.
    """
    start = briefing.start
    x, y, yaw = (repr(float(value)) for value in (start.x, start.y, start.yaw))
    return {
        **settings.files,
        "start.x": x,
        "start.y": y,
        "start.yaw": yaw,
        "namespace": settings.namespace.strip("/"),
        "robot.name": briefing.robot.name,
        "seed": str(int(briefing.seed.generate_state(1)[0])),
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
            raise PlaceholderError(f'"{token}" does not belong to a placeholder', _DOUBLED)
        else:
            yield token, ""


def _unknown(name: str, offered: Iterable[str]) -> PlaceholderError:
    return PlaceholderError(
        f'no placeholder "{name}"', f"{did_you_mean(name, offered)}; {_DOUBLED}", name
    )
