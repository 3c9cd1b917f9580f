"""Speed that a stack allows, and time-outs of its own that are in the way.

Nav2 does some things by the simulated clock and others by the wall clock. Sources:
nav2_controller/src/controller_server.cpp and nav2_lifecycle_manager of each distribution.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

from daemon.model.sut import TICK_RATE
from daemon.stacks.ros2.inspection import CheckLine, Inspection
from daemon.stacks.ros2.settings import Ros2Settings

WALL_CLOCK_CONTROLLERS: Final = frozenset({"humble", "iron", "jazzy", "kilted"})
"""Distributions whose controller_server loops on ``rclcpp::WallRate``, whatever ``/clock`` does;
from Lyrical on it is the node's clock."""
_SIMULATED_CLOCK_CONTROLLERS: Final = frozenset({"lyrical", "rolling"})
"""Those whose controller_server loops on the node's clock; Rolling since April 2026."""
_SHORTEST_ACKNOWLEDGEMENT: Final = 500.0
"""[ms] With 20 ms, the default of bringup, two of three goals failed beside another job on the
machine (Jazzy); with 1000 ms none did."""
_EQUAL: Final = 0.01
"""Rates that differ by less than this share are meant to be the same."""


def about_speed(inspection: Inspection) -> CheckLine:
    """Say whether runs can be faster than real time, and what would have to change."""
    name = inspection.identity.distribution
    if name in WALL_CLOCK_CONTROLLERS:
        return CheckLine(
            "speed",
            "note",
            f"at most real time: the controller of Nav2 runs on the wall clock in {name.title()}, "
            "whatever /clock does",
            "ROS 2 Lyrical or later is as fast as the stack can; here a controller_frequency that "
            "is raised by a factor allows that factor, then look at velocity smoother and "
            "progress checker too",
        )
    if name in _SIMULATED_CLOCK_CONTROLLERS:
        text = f"as fast as the stack answers: in {name.title()} Nav2's controller follows /clock"
        hint = "" if name == "lyrical" else "in a Rolling of before April 2026 it does not"
        return CheckLine("speed", "ok", text, hint)
    which = (
        f'the distribution "{name}" is not known here' if name else "its distribution is unknown"
    )
    return CheckLine(
        "speed",
        "note",
        f"{which}: whether it can be faster than real time cannot be said",
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
                f"{acknowledgement:g} ms of wall clock for a server to acknowledge: on a machine "
                "with other work goals are aborted by that and not by the robot",
                "set it to 1000 or more",
            )
        asked = any(report.replace(" ", "_") in node for report in settings.record)
        if asked and values.get("always_send_full_costmap") is False:
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
                f"nodes that are silent for {bond:g} s of wall clock are taken for dead",
                "set it to 0.0 where a cycle may take long",
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
            f"false in {named}: what they compute is of another time than what they are sent",
            "start them with use_sim_time: true",
        )
    elif any(values.get("use_sim_time") is True for values in parameters.values()):
        yield CheckLine("use_sim_time", "ok", "true in every node of the run that says")


def _controller(period: float, node: str, frequency: float, distribution: str) -> CheckLine:
    """Compare how often a controller answers with how often it is asked."""
    subject, ratio = f"{node} controller_frequency", frequency * period
    each = f"{frequency:g} Hz, a command every {1.0 / frequency:g} s"
    if abs(ratio - 1.0) <= _EQUAL:
        return CheckLine(subject, "ok", f"{each}, as the period of the cycles says")
    if ratio < 1.0:
        answered = max(1, math.ceil(TICK_RATE / frequency - 1e-6)) / TICK_RATE
        return CheckLine(
            subject,
            "warning",
            f"{each}, but cycles are {period:g} s: there is no answer to most of them"
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
