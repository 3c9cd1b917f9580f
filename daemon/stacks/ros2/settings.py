"""How a ROS 2 stack is started, spoken to and waited for: the settings of one SUT file, checked.

Times are seconds, shares fractions, names of topics, actions and nodes absolute. The tree of
parameters that they are read from has the keys of :class:`daemon.stacks.ros2.keys.Ros2Keys` as
they were written, and ``repeatable: false``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import BaseModel, Field, ValidationError

from daemon.model.attachments import FILES_PARAMETER
from daemon.stacks.findings import (
    ParameterError,
    ParameterFinding,
    ParameterLocation,
)
from daemon.stacks.ros2.keys import Mission, Reliability, Ros2Keys
from daemon.stacks.ros2.placeholders import MAP, STANDARD, check_placeholders, fill
from grammars.model.robot import Laser
from grammars.text.documents import explain_finding

ActionKind: TypeAlias = Literal["navigate_to_pose", "follow_waypoints", "navigate_through_poses"]
_FILE_NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,59}$"
_ACTIONS: Final[Mapping[Mission, ActionKind]] = MappingProxyType(
    {
        "waypoints": "navigate_to_pose",
        "follow": "follow_waypoints",
        "through": "navigate_through_poses",
    }
)


class _Ros2Parameters(Ros2Keys):
    """The tree of parameters: the keys, and the files that travel, by name."""

    files: dict[Annotated[str, Field(pattern=_FILE_NAME)], str] | None = None


@dataclass(frozen=True, slots=True)
class Container:
    """A container that the stack is started in; ``options`` are words for ``run``."""

    image: str
    engine: Literal["podman", "docker"] = "podman"
    network: str = "none"
    options: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TopicNames:
    """Names of topics; absolute in :class:`Ros2Settings`.

    ``scan`` is that of a robot's only laser, and with ``_NAME`` behind it of one of several;
    ``scans`` are topics by the names of lasers, which count first.
    """

    scan: str = "scan"
    scans: Mapping[str, str] = dataclasses.field(default_factory=dict)
    odom: str = "odom"
    command: str = "cmd_vel"
    tf: str = "/tf"
    tf_static: str = "/tf_static"
    map: str = "map"
    initial_pose: str = "initialpose"
    plan: str = "plan"
    local_plan: str = "local_plan"
    pose: str = "amcl_pose"
    particles: str = "particle_cloud"


@dataclass(frozen=True, slots=True)
class SensorQos:
    """How sensor data is published."""

    scan: Reliability = "best effort"
    odom: Reliability = "best effort"


@dataclass(frozen=True, slots=True)
class Frames:
    """Names of frames, as tf2 has them.

    ``laser`` is that of a robot's only laser, and with ``_NAME`` behind it of one of several;
    ``lasers`` are frames by the names of lasers, which count first.
    """

    map: str = "map"
    odom: str = "odom"
    base: str = "base_link"
    laser: str = "laser"
    lasers: Mapping[str, str] = dataclasses.field(default_factory=dict)

    def of_laser(self, laser: Laser) -> str:
        """Return the frame of a laser."""
        return self.lasers.get(laser.name) or _of_several(self.laser, laser)


@dataclass(frozen=True, slots=True)
class Ros2Settings:
    """Everything about a stack that its user sets; what a key means stands in ``Ros2Keys``.

    ``launch`` is empty when the container's own command starts the stack. ``domain`` is ``None``
    for one that the run has for itself. ``namespace`` is absolute, or empty. ``files`` are paths
    by name, or digests before they are resolved. :func:`fill_settings` fills placeholders.
    """

    launch: str = ""
    container: Container | None = None
    setup: tuple[str, ...] = ()
    domain: int | None = None
    environment: Mapping[str, str] = dataclasses.field(default_factory=dict)
    python: str = "python3"
    files: Mapping[str, str] = dataclasses.field(default_factory=dict)
    namespace: str = ""
    topics: TopicNames = TopicNames()
    qos: SensorQos = SensorQos()
    frames: Frames = Frames()
    map: Literal["file", "published"] = "file"
    transforms: Literal["all", "odom", "none"] = "all"
    initial_pose: Literal["published", "none"] = "published"
    mission: Mission = "waypoints"
    action: str = ""
    ready: tuple[str, ...] = ()
    start_up: float = 60.0
    patience: float = 1.0
    late: float = 0.05
    tolerance: float = 0.0
    idle: float = 0.02
    period: float = 0.05

    def scan_topic(self, laser: Laser) -> str:
        """Return where the scans of a laser are published."""
        return self.topics.scans.get(laser.name) or _of_several(self.topics.scan, laser)

    @property
    def action_kind(self) -> ActionKind:
        """Which of Nav2's actions the mission is sent by."""
        return _ACTIONS[self.mission]


def read_settings(parameters: Mapping[str, Any]) -> Ros2Settings:
    """Return the settings in a tree of parameters.

    Raises :class:`~daemon.stacks.findings.ParameterError` with everything that is wrong.
    """
    given = {name: value for name, value in parameters.items() if name != "repeatable"}
    problems = []
    if parameters.get("repeatable", False) is not False:
        message = "a stack outside of the simulation is never repeatable"
        problems.append(ParameterFinding(("repeatable",), message, "leave it out"))
    try:
        keys = _Ros2Parameters.model_validate(given)
    except ValidationError as error:
        raise ParameterError([*problems, *map(_in_words, error.errors())]) from error
    settings = _resolved(keys)
    problems += [*_start_problems(keys), *_placeholder_problems(settings)]
    if problems:
        raise ParameterError(problems)
    return settings


def placeholder_names(settings: Ros2Settings) -> tuple[str, ...]:
    """Return the names that may stand in braces, the files' among them."""
    standard = [name for name in STANDARD if name != MAP or settings.map == "file"]
    return (*standard, *settings.files)


def texts_with_placeholders(settings: Ros2Settings) -> Iterator[tuple[ParameterLocation, str]]:
    """Yield every text that is filled, with its place in the tree."""
    if settings.launch:
        yield ("launch",), settings.launch
    for name, value in settings.environment.items():
        yield ("environment", name), value
    if settings.container is not None:
        yield ("container", "image"), settings.container.image
        for index, option in enumerate(settings.container.options):
            yield ("container", "options", index), option


def fill_settings(settings: Ros2Settings, values: Mapping[str, str]) -> Ros2Settings:
    """Return the settings with placeholders filled: quoted in ``launch`` alone.

    Raises :class:`~daemon.stacks.ros2.placeholders.PlaceholderError` for a value that is missing.
    """
    container = settings.container
    if container is not None:
        container = dataclasses.replace(
            container,
            image=fill(container.image, values, quoted=False),
            options=tuple(fill(option, values, quoted=False) for option in container.options),
        )
    environment = {
        name: fill(value, values, quoted=False) for name, value in settings.environment.items()
    }
    return dataclasses.replace(
        settings,
        launch=fill(settings.launch, values),
        environment=environment,
        container=container,
    )


def absolute_name(namespace: str, name: str) -> str:
    """Return a name as the graph has it: one without a slash before it is in the namespace."""
    return name if name.startswith("/") else f"{namespace}/{name}"


def _resolved(keys: _Ros2Parameters) -> Ros2Settings:
    """Return settings in which names are absolute and nothing is left out."""
    given = _set(keys, leave=["container", "environment", "files", "frames", "qos", "topics"])
    namespace = "/" + (keys.namespace or "").strip("/")
    namespace = "" if namespace == "/" else namespace
    environment = keys.environment
    variables = {} if environment is None else environment.__pydantic_extra__ or {}
    domain = None if environment is None else environment.domain
    topics = TopicNames(**_by_laser(_set(keys.topics), "scan", "scans"))
    action = keys.action or _ACTIONS[keys.mission or "waypoints"]
    container = None if keys.container is None else _set(keys.container)
    if container is not None:
        # A container without an image is refused below; its place is what counts until then.
        container = {"image": "", **container, "options": tuple(container.get("options", ()))}
    return Ros2Settings(
        **{
            **given,
            "namespace": namespace,
            "action": absolute_name(namespace, action),
            "ready": tuple(absolute_name(namespace, name) for name in keys.ready or ()),
        },
        container=None if container is None else Container(**container),
        setup=tuple(environment.setup or ()) if environment is not None else (),
        domain=None if domain == "own" else domain,
        environment={name: value for name, value in variables.items() if value is not None},
        files=dict(keys.files or {}),
        topics=TopicNames(
            **{
                field.name: _absolute_names(namespace, getattr(topics, field.name))
                for field in dataclasses.fields(topics)
            }
        ),
        qos=SensorQos(**_set(keys.qos)),
        frames=Frames(**_by_laser(_set(keys.frames), "laser", "lasers")),
    )


def _absolute_names(namespace: str, names: str | Mapping[str, str]) -> Any:
    """Return a name, or each of names by laser, absolute."""
    if isinstance(names, str):
        return absolute_name(namespace, names)
    return {laser: absolute_name(namespace, name) for laser, name in names.items()}


def _by_laser(given: dict[str, Any], one: str, several: str) -> dict[str, Any]:
    """Return ``given`` with names by laser, which share a key with a single name, apart."""
    names = given.get(one)
    if not isinstance(names, dict):
        return given
    return {name: value for name, value in given.items() if name != one} | {several: names}


def _of_several(name: str, laser: Laser) -> str:
    return f"{name}_{laser.name}" if laser.name else name


def _set(model: BaseModel | None, leave: list[str] | None = None) -> dict[str, Any]:
    """Return the fields of a model that have a value, by their names in Python."""
    if model is None:
        return {}
    fields = {name: getattr(model, name) for name in type(model).model_fields}
    return {n: v for n, v in fields.items() if v is not None and n not in (leave or ())}


def _in_words(error: Any) -> ParameterFinding:
    path, message, hint = explain_finding(_Ros2Parameters, error)
    return ParameterFinding(tuple(part for part in path if part != "[key]"), message, hint)


def _start_problems(keys: _Ros2Parameters) -> Iterator[ParameterFinding]:
    """Yield what keeps the stack from being started at all."""
    if keys.launch is None and keys.container is None:
        message = 'key "launch" is missing: the command that starts the stack'
        yield ParameterFinding(("launch",), message, "or name an image below container")
    container = keys.container
    if container is not None and container.image is None:
        message = 'key "image" is missing: the image the stack is started in'
        yield ParameterFinding(("container", "image"), message)
    for name in keys.files or ():
        if name in STANDARD:
            message = f'{name}: every run has a placeholder "{name}"'
            yield ParameterFinding((FILES_PARAMETER, name), message, "call the file otherwise")


def _placeholder_problems(settings: Ros2Settings) -> Iterator[ParameterFinding]:
    known = placeholder_names(settings)
    for path, text in texts_with_placeholders(settings):
        for problem in check_placeholders(text, known):
            hint = problem.hint
            if problem.name == MAP and settings.map == "published":
                hint = "the map is published, not written: leave it out, or write map: file"
            yield ParameterFinding(path, problem.message, hint)
