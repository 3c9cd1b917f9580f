"""Inspection of a stack: it is brought up as for a run, looked at, and ended; no mission is sent.

:mod:`daemon.stacks.ros2.checkup` compares the inspection with the needs of a run.
"""

from __future__ import annotations

import dataclasses
import time as wall_clock
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

from daemon.model.sut import Briefing, Observation, Odometry, SutFailure
from daemon.stacks.ros2 import sensors
from daemon.stacks.ros2.link import Cycle, Graph, LinkLost, Readiness, StackIdentity
from daemon.stacks.ros2.settings import Ros2Settings

if TYPE_CHECKING:
    from daemon.stacks.ros2.bring_up import StackSession
    from daemon.stacks.ros2.relay_link import RelayLink

PARAMETERS: Final = (
    "use_sim_time", "controller_frequency", "default_server_timeout", "bond_timeout",
    "always_send_full_costmap",
)  # fmt: skip
"""Parameters that nodes are asked for."""

_NANO: Final = 1_000_000_000
_LISTENING: Final = 1.0
"""Others are listened to for this long [s of wall clock]; odometry comes ten times as often."""
_ASKING: Final = 20.0
"""Nodes are asked for parameters for at most this long [s of wall clock]: each may take two."""
_GET_PARAMETERS: Final = "/get_parameters"


@dataclass(frozen=True, slots=True)
class Inspection:
    """State of a stack that is up, or that did not come up in time.

    ``parameters`` are those of :data:`PARAMETERS` that nodes have, by absolute name of the node;
    ``transforms`` (parent, child) come from others than this side. ``located``: it knows where the
    robot is in the map. ``failure`` says why it did not come up, ``None`` when it did, after
    ``seconds`` of wall clock.
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

    ``state``: ``missing`` keeps runs from working, ``warning`` will probably do so, ``note`` is
    good to know. ``text`` says what is so and ``hint`` what to do. Of a topic or an action there
    is its type, ``kind``; of a topic ``qos`` as it is published from here, and how many
    ``publishers`` and ``listeners`` the stack has.
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
    """Start a stack, look at it, and end it.

    ``first`` is what the robot would measure at the start; ``on_progress`` hears what is being
    waited for; ``on_end`` gets what stack and relay have printed, by name, also after a failure.
    Raises :class:`SutFailure` when the stack cannot be started or nothing can be asked; one that
    only does not get ready is looked at.
    """
    # What starts processes is loaded when something is started.
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
            # The reason why it did not come up says more than its end.
            raise failure or session.failure(session.explain(error)) from error
        return dataclasses.replace(inspection, seconds=seconds, failure=failure)
    finally:
        printed = {} if attempt.session is None else attempt.session.close()
        on_end({**attempt.outputs, **printed})


def _look(session: StackSession, settings: Ros2Settings, standing: Odometry) -> Inspection:
    """Return everything a session can be asked; raises :class:`LinkLost`."""
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
    """Yield parents and children of the transforms that come while this side publishes none."""
    topics, period = settings.topics, settings.period
    cycles = max(2, round(_LISTENING / period))
    for number in range(cycles):
        after = session.time + round(period * _NANO)
        answer = session.cycle(Cycle(after, (), "nothing", period))
        # A stack may find out only now where the robot is.
        session.telemetry.read(answer.messages, 0.0, standing)
        # In the first there may still be what this side has published before.
        for message in answer.messages if number else ():
            if message.topic in (topics.tf, topics.tf_static):
                yield from _frames(message.data)


def _frames(data: bytes) -> Iterator[tuple[str, str]]:
    """Yield parents and children; bring-up has reported a damaged message already."""
    try:
        transforms = sensors.read_message(data, sensors.TRANSFORMS).transforms
    except ValueError:
        return
    for transform in transforms:
        yield transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")


def _parameters(link: RelayLink, graph: Graph) -> dict[str, Mapping[str, Any]]:
    """Return what nodes say of :data:`PARAMETERS`; those that come last may not be asked."""
    until = wall_clock.monotonic() + _ASKING
    values: dict[str, Mapping[str, Any]] = {}
    for service in sorted(graph.services):
        if service.endswith(_GET_PARAMETERS) and wall_clock.monotonic() < until:
            node = service.removesuffix(_GET_PARAMETERS)
            values[node] = link.parameters(node, PARAMETERS)
    return values
