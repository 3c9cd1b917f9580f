"""Possible speed of a stack, and its own time-outs that limit it.

Nav2 uses the simulated clock in some places and the wall clock in others. Sources:
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
"""Distributions whose controller_server loops on ``rclcpp::WallRate``, not by ``/clock``."""
_SIMULATED_CLOCK_CONTROLLERS: Final = frozenset({"lyrical", "rolling"})
"""Distributions whose controller_server loops on the node's clock; Rolling since April 2026."""
_SHORTEST_ACKNOWLEDGEMENT: Final = 500.0
"""Shortest sound time-out [ms]. With 20 ms, the default of bringup, two of three goals failed
beside another job on the machine (Jazzy); with 1000 ms all succeeded."""
_EQUAL: Final = 0.01
"""Largest relative difference of equal rates."""


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
