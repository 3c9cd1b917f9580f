"""Lines of a check: needs of a run against the graph of a stack, with remedies.

This module does not talk to the stack. Quality of service is matched as in DDS: a subscription does
not hear a publisher that offers less than it requires, and neither of them reports that.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from daemon.stacks.ros2.endpoints import link_setup, scan_topics
from daemon.stacks.ros2.inspection import (
    CheckLine,
    CheckState,
    Inspection,
    about_parameters,
    about_speed,
)
from daemon.stacks.ros2.link import (
    ACTION_KINDS,
    COMMAND_KINDS,
    Graph,
    GraphEndpoint,
    LinkSetup,
    TopicSetup,
)
from daemon.stacks.ros2.settings import Ros2Settings
from daemon.stacks.ros2.telemetry import report_subscriptions, report_topics
from grammars.model.robot import Laser
from grammars.text.diagnostics import closest
from grammars.text.words import first_words

CLOCK: Final = TopicSetup("/clock", "rosgraph_msgs/msg/Clock")

_ZENOH: Final = "rmw_zenoh_cpp"
"""Zenoh has no incompatible quality of service."""
_GET_STATE: Final = "/get_state"
_SEND_GOAL: Final = "/_action/send_goal"


@dataclass(frozen=True, slots=True)
class StackCheck:
    """Comparison of a started external system with the needs of a run.

    ``failure`` is the reason why it did not start or get ready, ``printed`` holds its most telling
    output lines. ``lines`` are empty if there was nothing to inspect. The check took ``seconds`` of
    wall clock. ``outputs`` are files with the whole output.
    """

    sut: str
    failure: str = ""
    printed: tuple[str, ...] = ()
    distribution: str = ""
    rmw: str = ""
    seconds: float = 0.0
    lines: tuple[CheckLine, ...] = ()
    outputs: tuple[str, ...] = ()


def examine(
    settings: Ros2Settings, inspection: Inspection, lasers: Sequence[Laser]
) -> tuple[CheckLine, ...]:
    """Return a line for every need of a run and for every obstacle.

    ``lasers`` are those of the robot of the inspection.
    """
    return tuple(_Checkup(settings, inspection, lasers).lines())


@dataclass(frozen=True, slots=True)
class _Published:
    """A topic published from here: severity and consequence if it has no listener."""

    topic: TopicSetup
    key: str
    unheard: CheckState
    consequence: str


class _Checkup:
    """Check of one stack."""

    def __init__(
        self, settings: Ros2Settings, inspection: Inspection, lasers: Sequence[Laser]
    ) -> None:
        self._settings, self._inspection = settings, inspection
        self._graph: Graph = inspection.graph
        self._setup: LinkSetup = link_setup(settings, lasers)
        self._lasers, self._scans = lasers, scan_topics(settings, lasers)
        self._lenient = inspection.identity.rmw == _ZENOH

    def lines(self) -> Iterator[CheckLine]:
        """Yield all lines, in the order of a run."""
        yield self._stack()
        yield from self._nodes()
        yield from self._clock()
        for published in self._published():
            yield from self._heard(published)
        yield from self._command()
        yield self._action()
        yield from self._transforms()
        yield from self._recorded()
        yield from about_parameters(self._settings, self._inspection, self._concerned())
        yield about_speed(self._inspection)

    def _stack(self) -> CheckLine:
        identity, took = self._inspection.identity, self._inspection.seconds
        name = f"ROS 2 {identity.distribution.title() or 'of unknown distribution'}"
        what = f"{name}, {identity.rmw}"
        if self._inspection.failure:
            why = self._inspection.failure.reason
            return CheckLine("start-up", "missing", f"{what}: {why}", "see the lines below")
        return CheckLine("start-up", "ok", f"{what}, ready after {took:.1f} s of wall clock")

    def _nodes(self) -> Iterator[CheckLine]:
        """Yield the state of every lifecycle node that must be active."""
        lifecycle = self._owners(_GET_STATE)
        states = self._inspection.readiness.nodes
        for node in self._settings.ready:
            state = states.get(node, "")
            if state == "active":
                yield CheckLine(node, "ok", "active")
            elif node in lifecycle or state:
                yield CheckLine(
                    node,
                    "missing",
                    f"{state or 'its state is unknown'}: it must be active",
                    "see what it logs; a lifecycle manager with autostart: true activates nodes",
                )
            else:
                yield CheckLine(
                    node, "missing", _absence(node, self._graph), _nearest(node, lifecycle)
                )
        if not self._settings.ready and lifecycle:
            above = f"{self._settings.namespace}/"
            listed = ", ".join(name.removeprefix(above) for name in sorted(lifecycle))
            text = "no nodes are waited for, and there are lifecycle nodes"
            yield CheckLine("ready", "note", text, f"write ready: [{listed}]")

    def _clock(self) -> Iterator[CheckLine]:
        """Yield the listeners of the clock, or other publishers, which must not exist."""
        others = self._ends(CLOCK.name, "publisher")
        listeners = self._ends(CLOCK.name, "subscription")
        if others:
            yield self._line(
                CLOCK,
                "missing",
                f"published by {_names(others)} too: time jumps back and forth",
                "stop this simulator, or the bag that publishes its clock",
            )
        elif not listeners:
            yield self._line(
                CLOCK, "missing", "nobody listens: the stack runs on the wall clock",
                "start its nodes with use_sim_time: true",
            )  # fmt: skip
        else:
            yield self._line(CLOCK, "ok", f"heard by {_names(listeners)}")

    def _published(self) -> Iterator[_Published]:
        """Yield the topics published from here, most important first."""
        topics = self._settings.topics
        # A stack may ignore one of several lasers, but not all of them.
        audible = [name for name in self._scans if self._ends(name, "subscription")]
        scan: tuple[str, CheckState, str] = ("scan", "missing", "the stack is blind")
        if audible and len(self._scans) > 1:
            scan = ("scan", "warning", "the stack does not see what this laser sees")
        meaning: dict[str, tuple[str, CheckState, str]] = {
            **dict.fromkeys(self._scans, scan),
            topics.tf: ("tf", "missing", "nobody knows where the robot is"),
            topics.odom: ("odom", "note", "speeds are not used, or come from elsewhere"),
            topics.tf_static: ("tf-static", "warning", "nobody knows where lasers are"),
            topics.map: ("map", "missing", "the stack has no map"),
            topics.initial_pose: (
                "initial-pose",
                "warning",
                "the stack does not receive its start pose, so it must know it",
            ),
        }
        published = {topic.name: topic for topic in self._setup.publish}
        if self._settings.initial_pose == "none":
            published.pop(topics.initial_pose, None)
        for name, (key, unheard, consequence) in meaning.items():
            if name in published:
                yield _Published(published[name], key, unheard, consequence)

    def _heard(self, published: _Published) -> Iterator[CheckLine]:
        """Yield whether a topic is heard, and obstacles between it and its listeners."""
        topic = published.topic
        ears = self._ends(topic.name, "subscription")
        obstacles = [(ear, *self._obstacle(published, ear)) for ear in ears]
        hearing = [ear for ear, reason, _ in obstacles if not reason]
        if hearing:
            yield self._line(topic, "ok", f"heard by {_names(hearing)}")
        elif not ears:
            text = f"nobody listens: {published.consequence}"
            hint = self._elsewhere(published) if published.unheard != "note" else ""
            yield self._line(topic, published.unheard, text, hint)
        # If other listeners hear the topic, runs may still work.
        is_missing = published.unheard == "missing" and not hearing
        state: CheckState = "missing" if is_missing else "warning"
        for ear, reason, hint in obstacles:
            if reason:
                yield self._line(topic, state, f"{ear.node} does not hear it: {reason}", hint)
        if published.key in ("scan", "odom"):
            others = self._ends(topic.name, "publisher")
            if others:
                yield self._line(
                    topic,
                    "warning",
                    f"published by {_names(others)} too: listeners get both in turns",
                    "stop it, or give this one another name below topics",
                )

    def _obstacle(self, published: _Published, ear: GraphEndpoint) -> tuple[str, str]:
        """Return why a subscription does not hear a topic, and the remedy; empty if it does."""
        topic, key = published.topic, published.key
        if ear.kind != topic.kind:
            hint = f"give it another topic below topics: {{{key}: ...}}"
            return f"it expects {ear.kind}", hint
        if self._lenient:
            return "", ""
        if ear.reliable and topic.qos == "best effort":
            return "it wants a reliable publisher", f"write qos: {{{key}: reliable}}"
        if ear.transient_local and topic.qos != "latched":
            reason = "it wants a publisher that keeps the last message (transient local)"
            return reason, "make its subscription volatile: new messages come all the time"
        return "", ""

    def _command(self) -> Iterator[CheckLine]:
        """Yield the publishers of commands, and their type."""
        name = self._settings.topics.command
        speaking = self._ends(name, "publisher")
        usable = [end for end in speaking if end.kind in COMMAND_KINDS]
        kinds = sorted({end.kind for end in usable})
        either = " or ".join(kind.rpartition("/")[2] for kind in COMMAND_KINDS)
        topic = TopicSetup(name, kinds[0] if kinds else either)
        for end in speaking:
            if end.kind not in COMMAND_KINDS:
                text = f"{end.node} publishes {end.kind}, which is ignored"
                yield self._line(TopicSetup(name, end.kind), "warning", text, f"use {either}")
        if not usable:
            others = {
                end.topic
                for end in self._graph.endpoints
                if end.role == "publisher" and end.kind in COMMAND_KINDS
            }
            where = [f"write topics: {{command: {other}}}" for other in sorted(others)]
            hint = " or ".join(where) or "see why the controller is not there"
            yield self._line(topic, "missing", "nobody publishes it: the robot never moves", hint)
        elif len(kinds) > 1:
            text = f"published as {' and '.join(kinds)}: only one of them is used"
            yield self._line(topic, "missing", text, "set enable_stamped_cmd_vel alike everywhere")
        else:
            stamped = kinds[0] == COMMAND_KINDS[0]
            how = "answers are known by their stamps" if stamped else (
                "it has no stamp, so whatever comes after the clock counts as the answer"
            )  # fmt: skip
            yield self._line(topic, "ok", f"published by {_names(usable)}; {how}")

    def _action(self) -> CheckLine:
        """Return whether there is an action server for the mission."""
        action, kind = self._settings.action, ACTION_KINDS[self._settings.action_kind]
        if self._inspection.readiness.server:
            return CheckLine(action, "ok", "the action server is there", kind=kind)
        actions = self._owners(_SEND_GOAL)
        text = "no action server, so the mission cannot be sent"
        return CheckLine(action, "missing", text, _nearest(action, actions, "action: "), kind)

    def _transforms(self) -> Iterator[CheckLine]:
        """Yield whether the stack publishes the robot's pose, and foreign odometry."""
        frames, here = self._settings.frames, self._settings.transforms != "none"
        if self._inspection.located:
            yield CheckLine(f"{frames.map} -> {frames.base}", "ok", "the transform is known")
        else:
            yield CheckLine(
                f"{frames.map} -> {frames.base}",
                "warning",
                "no such transform: no estimate is recorded, and most planners need it",
                "look at localisation, and at the names below frames",
            )
        elsewhere = (frames.odom, frames.base) in self._inspection.transforms
        subject = f"{frames.odom} -> {frames.base}"
        if elsewhere and here:
            yield CheckLine(
                subject,
                "warning",
                "the stack publishes it too: the robot jumps between two odometries",
                "write transforms: none, or end what publishes it (robot_localization, a driver)",
            )
        elif not elsewhere and not here:
            text = "nobody publishes it, and with transforms: none the simulator does not either"
            yield CheckLine(subject, "missing", text, "write transforms: odom")

    def _recorded(self) -> Iterator[CheckLine]:
        """Yield whether each report of ``record`` is published in a readable form."""
        reports = report_topics(self._settings)
        for topic in report_subscriptions(self._settings):
            ends = self._ends(topic.name, "publisher")
            obstacles = [(end, self._unrecorded(topic, end)) for end in ends]
            readable = [end for end, reason in obstacles if not reason]
            if readable:
                yield self._line(topic, "ok", f"published by {_names(readable)}; it is recorded")
            elif not ends:
                text = "nobody publishes it, so it is not recorded"
                others = {
                    end.topic
                    for end in self._graph.endpoints
                    if end.role == "publisher" and end.kind == topic.kind
                } - {*reports, self._settings.topics.map}
                key = reports[topic.name].replace(" ", "-")
                where = [f"topics: {{{key}: {other}}}" for other in sorted(others)]
                hint = f"write {' or '.join(where)}" if where else ""
                yield self._line(topic, "warning", text, hint)
            for end, reason in obstacles:
                if reason:
                    yield self._line(topic, "warning", f"not recorded from {end.node}: {reason}")

    def _unrecorded(self, topic: TopicSetup, end: GraphEndpoint) -> str:
        """Return why messages of a publisher do not arrive, empty if they do."""
        if end.kind != topic.kind:
            return f"it publishes {end.kind}"
        if self._lenient or (end.reliable and (end.transient_local or topic.qos != "latched")):
            return ""
        return f"its publisher is not {'reliable' if not end.reliable else 'transient local'}"

    def _concerned(self) -> frozenset[str]:
        """Return the nodes that a run depends on."""
        topics = {CLOCK.name, self._setup.command, *(topic.name for topic in self._setup.publish)}
        talking = {end.node for end in self._graph.endpoints if end.topic in topics}
        return frozenset({*talking, *self._settings.ready})

    def _elsewhere(self, published: _Published) -> str:
        """Return a hint with topics of the type that have listeners but no publisher."""
        ends = self._graph.endpoints
        published_topics = {end.topic for end in ends if end.role == "publisher"}
        awaited = {
            end.topic
            for end in ends
            if end.role == "subscription" and end.kind == published.topic.kind
        } - published_topics
        unserved = awaited - {topic.name for topic in self._setup.publish}
        where = [f"topics: {{{self._key(published, topic)}}}" for topic in sorted(unserved)]
        return f"write {' or '.join(where)}" if where else ""

    def _key(self, published: _Published, topic: str) -> str:
        """Return the entry below ``topics`` that gives a published topic another name."""
        if published.key == "scan" and len(self._lasers) > 1:
            here = (x for x in self._lasers if self._settings.scan_topic(x) == published.topic.name)
            return f"scan: {{{', '.join(f'{laser.name}: {topic}' for laser in here)}}}"
        return f"{published.key}: {topic}"

    def _ends(self, topic: str, role: str) -> list[GraphEndpoint]:
        return [e for e in self._graph.endpoints if e.topic == topic and e.role == role]

    def _owners(self, ending: str) -> set[str]:
        """Return the names of nodes or actions that have a service of this ending."""
        services = self._graph.services
        return {name.removesuffix(ending) for name in services if name.endswith(ending)}

    def _line(self, topic: TopicSetup, state: CheckState, text: str, hint: str = "") -> CheckLine:
        own = topic is CLOCK or topic in self._setup.publish
        return CheckLine(
            topic.name, state, text, hint, topic.kind, topic.qos if own else "",
            len(self._ends(topic.name, "publisher")), len(self._ends(topic.name, "subscription")),
        )  # fmt: skip


def _absence(node: str, graph: Graph) -> str:
    if node in graph.nodes:
        return "it is not a lifecycle node, so it has no state"
    return "there is no such node"


def _nearest(name: str, names: Iterable[str], prefix: str = "") -> str:
    """Return a hint with the nearest name in the graph, or with all names of the kind."""
    existing = sorted(names)
    close = closest(name, existing) or next(
        (one for one in existing if one.rpartition("/")[2] == name.rpartition("/")[2]), ""
    )
    if close:
        return f'did you mean "{prefix}{close}"?'
    return f"there are {', '.join(existing)}" if existing else "the graph has none of this kind"


def _names(ends: Sequence[GraphEndpoint]) -> str:
    return first_words(dict.fromkeys(end.node for end in ends))
