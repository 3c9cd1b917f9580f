"""Inspection of a stack: bring it up as for a run, inspect it, and end it, without a mission.

:mod:`daemon.stacks.ros2.checkup` compares the inspection with the needs of a run. Here are the
lines about the possible speed of a stack, and about its own time-outs: Nav2 uses the simulated
clock in some places and the wall clock in others. Sources:
nav2_controller/src/controller_server.cpp and nav2_lifecycle_manager of each distribution.
"""

from __future__ import annotations

import dataclasses
import math
import time as wall_clock
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

from daemon.model.sut import TICK_RATE, Briefing, Observation, Odometry, SutFailure
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.link import Cycle, Graph, LinkLost, Readiness, RelayLink, StackIdentity
from daemon.stacks.ros2.settings import Ros2Settings

if TYPE_CHECKING:
    from daemon.stacks.ros2.bring_up import StackSession

PARAMETERS: Final = (
    "use_sim_time", "controller_frequency", "default_server_timeout", "bond_timeout",
    "always_send_full_costmap",
)  # fmt: skip
"""Parameters to request from nodes."""

WALL_CLOCK_CONTROLLERS: Final = frozenset({"humble", "iron", "jazzy", "kilted"})
"""Distributions whose controller_server loops on ``rclcpp::WallRate``, not by ``/clock``."""
_SIMULATED_CLOCK_CONTROLLERS: Final = frozenset({"lyrical", "rolling"})
"""Distributions whose controller_server loops on the node's clock; Rolling since April 2026."""
_SHORTEST_ACKNOWLEDGEMENT: Final = 500.0
"""Shortest sound time-out [ms]. With 20 ms, the default of bringup, two of three goals failed
beside another job on the machine (Jazzy); with 1000 ms all succeeded."""
_EQUAL: Final = 0.01
"""Largest relative difference of equal rates."""

_NANO: Final = 1_000_000_000
_LISTENING: Final = 1.0
"""Time of listening for other transforms [s of wall clock]; odometry comes ten times as often."""
_ASKING: Final = 20.0
"""Longest time for requests of parameters [s of wall clock]; each may take two seconds."""
_GET_PARAMETERS: Final = "/get_parameters"


@dataclass(frozen=True, slots=True)
class Inspection:
    """State of a stack that is up, or that did not come up in time.

    ``parameters`` are those of :data:`PARAMETERS` that nodes have, by absolute name of the node.
    ``transforms`` (parent, child) come from other publishers. ``located``: the stack knows the
    robot's pose in the map. ``failure`` is the reason why it did not come up, ``None`` if it did,
    after ``seconds`` of wall clock.
    """

    identity: StackIdentity
    graph: Graph
    readiness: Readiness
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    transforms: frozenset[tuple[str, str]] = frozenset()
    located: bool = True
    seconds: float = 0.0
    failure: SutFailure | None = None


CheckState: TypeAlias = Literal["ok", "note", "warning", "missing"]


@dataclass(frozen=True, slots=True)
class CheckLine:
    """A thing a stack needs, has, or should not have; ``subject`` names it.

    ``state``: ``missing`` prevents runs, ``warning`` probably does, ``note`` is informative.
    ``text`` describes the finding and ``hint`` the remedy. ``kind`` is the type of a topic or an
    action. A topic also has the ``qos`` of its publisher here, and the numbers of ``publishers``
    and ``listeners`` in the stack.
    """

    subject: str
    state: CheckState
    text: str
    hint: str = ""
    kind: str = ""
    qos: str = ""
    publishers: int | None = None
    listeners: int | None = None


def inspect_stack(
    settings: Ros2Settings,
    briefing: Briefing,
    first: Observation,
    on_progress: Callable[[str], None],
    on_end: Callable[[Mapping[str, bytes]], None],
) -> Inspection:
    """Start a stack, inspect it, and end it.

    ``first`` is the robot's measurement at the start. ``on_progress`` receives progress messages,
    ``on_end`` the output of stack and relay by name, also after a failure. Raises
    :class:`SutFailure` if the stack does not start or does not answer; a stack that is merely not
    ready is inspected.
    """
    # Load the code that starts processes only when it is needed.
    from daemon.stacks.ros2.bring_up import BringUp

    attempt = BringUp(settings, briefing, first)
    began = wall_clock.monotonic()
    failure: SutFailure | None = None
    try:
        try:
            for waiting in attempt.run():
                on_progress(waiting)
        except SutFailure as error:
            failure = error
        seconds = wall_clock.monotonic() - began
        if failure is not None and attempt.session is None:
            raise failure
        session = attempt.ready_session()
        ended = session.process.ended()
        if ended:
            raise failure or session.failure(ended)
        on_progress("looking at its graph")
        try:
            inspection = _look(session, settings, first.odometry[-1])
        except LinkLost as error:
            # The reason of the failed bring-up explains more than the end of the link.
            raise failure or session.failure(session.explain(error)) from error
        return dataclasses.replace(inspection, seconds=seconds, failure=failure)
    finally:
        printed = {} if attempt.session is None else attempt.session.close()
        on_end({**attempt.outputs, **printed})


def _look(session: StackSession, settings: Ros2Settings, standing: Odometry) -> Inspection:
    """Return the inspection of a session; raises :class:`LinkLost`."""
    link = session.link
    transforms = frozenset(_foreign_transforms(session, settings, standing))
    graph = link.graph()
    return Inspection(
        identity=link.identity,
        graph=graph,
        readiness=link.readiness(),
        parameters=_parameters(link, graph),
        transforms=transforms,
        located=session.telemetry.pose() is not None,
    )


def _foreign_transforms(
    session: StackSession, settings: Ros2Settings, standing: Odometry
) -> Iterator[tuple[str, str]]:
    """Yield parents and children of transforms that come while this side publishes none."""
    topics, period = settings.topics, settings.period
    cycles = max(2, round(_LISTENING / period))
    for number in range(cycles):
        after = session.time + round(period * _NANO)
        answer = session.cycle(Cycle(after, (), "nothing", period))
        # A stack may localise the robot only now.
        session.telemetry.read(answer.messages, 0.0, standing)
        # The first answer may still contain transforms of this side.
        for message in answer.messages if number else ():
            if message.topic in (topics.tf, topics.tf_static):
                yield from _frames(message.data)


def _frames(data: bytes) -> Iterator[tuple[str, str]]:
    """Yield parents and children; bring-up has already reported damaged messages."""
    try:
        transforms = sensors.read_message(data, sensors.TRANSFORMS).transforms
    except ValueError:
        return
    for transform in transforms:
        yield transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")


def _parameters(link: RelayLink, graph: Graph) -> dict[str, Mapping[str, Any]]:
    """Return nodes' values of :data:`PARAMETERS`; the last nodes may be skipped."""
    until = wall_clock.monotonic() + _ASKING
    values: dict[str, Mapping[str, Any]] = {}
    for service in sorted(graph.services):
        if service.endswith(_GET_PARAMETERS) and wall_clock.monotonic() < until:
            node = service.removesuffix(_GET_PARAMETERS)
            values[node] = link.parameters(node, PARAMETERS)
    return values


def about_speed(inspection: Inspection) -> CheckLine:
    """Return whether runs can be faster than real time, with a remedy."""
    name = inspection.identity.distribution
    if name in WALL_CLOCK_CONTROLLERS:
        return CheckLine(
            "speed",
            "note",
            f"at most real time: the controller of Nav2 runs on the wall clock in {name.title()}, "
            "independent of /clock",
            "ROS 2 Lyrical or later is as fast as the stack; here a controller_frequency raised by "
            "a factor allows that factor, then adapt velocity smoother and progress checker too",
        )
    if name in _SIMULATED_CLOCK_CONTROLLERS:
        text = f"as fast as the stack answers: in {name.title()} Nav2's controller follows /clock"
        hint = "" if name == "lyrical" else "before April 2026 that of Rolling does not"
        return CheckLine("speed", "ok", text, hint)
    which = f'the distribution "{name}" is unknown here' if name else "its distribution is unknown"
    return CheckLine(
        "speed",
        "note",
        f"{which}, so its possible speed is unknown, too",
        "up to ROS 2 Kilted the controller of Nav2 runs on the wall clock, from Lyrical on it "
        "follows /clock",
    )


def about_parameters(
    settings: Ros2Settings, inspection: Inspection, concerned: frozenset[str]
) -> Iterator[CheckLine]:
    """Yield findings about parameters of nodes; the ``concerned`` ones are part of the run."""
    yield from _simulated_time(inspection.parameters, concerned)
    for node, values in inspection.parameters.items():
        frequency = _number(values, "controller_frequency")
        if frequency is not None and frequency > 0.0:
            yield _controller(settings.period, node, frequency, inspection.identity.distribution)
        acknowledgement = _number(values, "default_server_timeout")
        if acknowledgement is not None and acknowledgement < _SHORTEST_ACKNOWLEDGEMENT:
            yield CheckLine(
                f"{node} default_server_timeout",
                "warning",
                f"{acknowledgement:g} ms of wall clock for a server to acknowledge: a busy machine "
                "aborts goals by that, without any fault of the robot",
                "set it to 1000 or more",
            )
        is_recorded = any(report.replace(" ", "_") in node for report in settings.record)
        if is_recorded and values.get("always_send_full_costmap") is False:
            yield CheckLine(
                f"{node} always_send_full_costmap",
                "warning",
                "false: only whole costmaps are recorded, and this one sends its changes",
                "set it to true",
            )
        bond = _number(values, "bond_timeout")
        if bond is not None and bond > 0.0:
            yield CheckLine(
                f"{node} bond_timeout",
                "note",
                f"nodes that are silent for {bond:g} s of wall clock count as dead",
                "set it to 0.0 if a cycle may take long",
            )


def _simulated_time(
    parameters: Mapping[str, Mapping[str, Any]], concerned: frozenset[str]
) -> Iterator[CheckLine]:
    off = [
        node
        for node, values in parameters.items()
        if node in concerned and values.get("use_sim_time") is False
    ]
    if off:
        named = ", ".join(off)
        yield CheckLine(
            "use_sim_time",
            "missing",
            f"false in {named}: their results are of another time than their inputs",
            "start them with use_sim_time: true",
        )
    elif any(values.get("use_sim_time") is True for values in parameters.values()):
        yield CheckLine("use_sim_time", "ok", "true in every node of the run that has it")


def _controller(period: float, node: str, frequency: float, distribution: str) -> CheckLine:
    """Compare the rate of a controller with that of the cycles."""
    subject, ratio = f"{node} controller_frequency", frequency * period
    each = f"{frequency:g} Hz, a command every {1.0 / frequency:g} s"
    if abs(ratio - 1.0) <= _EQUAL:
        return CheckLine(subject, "ok", f"{each}, equal to the period of the cycles")
    if ratio < 1.0:
        answered = max(1, math.ceil(TICK_RATE / frequency - 1e-6)) / TICK_RATE
        return CheckLine(
            subject,
            "warning",
            f"{each}, but cycles are {period:g} s: most have no answer"
            if ratio <= 0.5
            else f"{each}, but cycles are {period:g} s: some have no answer",
            f"write period: {answered:g} s, or raise controller_frequency to {1 / period:g}",
        )
    if distribution in WALL_CLOCK_CONTROLLERS:
        return CheckLine(
            subject,
            "note",
            f"{each} of wall clock, and cycles are {period:g} s: up to {ratio:.3g} times real time",
        )
    return CheckLine(
        subject, "note", f"{each}, and cycles are {period:g} s: of several commands the last counts"
    )


def _number(values: Mapping[str, Any], name: str) -> float | None:
    value = values.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)
