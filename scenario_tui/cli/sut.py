"""Commands about a system under test: its parameters and their places; its check; its relay."""

from __future__ import annotations

import dataclasses
import json
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.commands import PlainFlagsGroup, command_of
from scenario_tui.cli.output import (
    plain_table,
    print_line,
    report_findings,
    stderr_console,
    stdout_console,
)
from scenario_tui.cli.sut_check import check, load_sut
from scenario_tui.text.formatting import NOT_REPEATABLE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from rich.console import Console

    from daemon.campaign import LoadedSut, ParameterValues
    from daemon.stacks.findings import ParameterFinding
    from daemon.stacks.ros1.configuration import RosParameters
    from daemon.stacks.ros1.costmap.layers import LayeredCostmap
    from scenario_tui.cli.values import ShownSut

_NOT_ROS_PARAMETERS: Final = frozenset({"layers", "frame", "recovery_behaviors"})
"""Fields of the models that are no parameters, or have no default to show."""
_LAYER_KINDS: Final = {
    "StaticLayer": "map",
    "ObstacleLayer": "obstacles",
    "VoxelLayer": "obstacles",
    "InflationLayer": "inflation",
}

app = typer.Typer(
    name="sut",
    cls=PlainFlagsGroup,
    help="Show a system under test, or start an external one and see what it lacks.",
    no_args_is_help=True,
    add_completion=False,
)


@command_of(app, "show")
def show(
    file: Annotated[
        str,
        typer.Argument(
            metavar="SUT.yaml",
            help="A system under test: its file, or its name in campaigns.",
            autocompletion=completion.offers(completion.sut_files),
        ),
    ],
) -> Answer[ShownSut]:
    """Show a system under test: its parameters and where each was written.

    For ROS stacks it also shows the defaults that apply. For the ROS 1 stack it adds parameters
    without effect, the planners, the layers of both costmaps, and the lasers of each part. Nothing
    is started.
    """
    from daemon.campaign import RefusedSutError
    from daemon.stacks.ros1 import ROS
    from scenario_tui.cli.values import ShownSut

    try:
        sut = load_sut(file, Path())
    except RefusedSutError as refused:
        _print_settings(stderr_console(), refused.settings, ())
        raise
    read = ROS.read(sut.reference.parameters) if sut.reference.kind == ROS.name else None
    unused = sut.findings.without_effect
    value = ShownSut(
        sut.reference,
        sut.layer.files,
        {"/".join(path): str(setting.where) for path, setting in sut.settings.items()},
        _defaults(sut, read),
        {"/".join(map(str, one.path)): one.message for one in unused},
        sut.warnings,
        {} if read is None else _ros_values(read),
    )
    return Answer("sut", value, partial(_print_sut, sut, read, value))


command_of(app, "check")(check)


@command_of(app, "relay")
def relay() -> None:
    """Print the relay that talks to a ROS 2 stack, one Python file, to build images.

    A run brings its own; an image needs the relay only if nothing can be mounted.
    """
    from importlib.resources import files

    # Read as a file, not imported: it is written for the Python of the stack.
    sys.stdout.write(files("daemon.stacks.ros2").joinpath("relay.py").read_text("utf-8"))


def _defaults(sut: LoadedSut, read: RosParameters | None) -> dict[str, dict[str, Any]]:
    """Return the defaults that apply by namespace or section, if the kind has any."""
    from daemon.stacks.ros2 import ROS2

    if sut.reference.kind == ROS2.name:
        from daemon.stacks.ros2.settings import settings_not_written

        return settings_not_written(ROS2.read(sut.reference.local_parameters))
    return {} if read is None else _ros_defaults(sut, read)


def _ros_defaults(sut: LoadedSut, read: RosParameters) -> dict[str, dict[str, Any]]:
    """Return the defaults of the ROS 1 stack by namespace."""
    from daemon.stacks.ros1.configuration import namespace_of

    planners = read.move_base.base_global_planner, read.move_base.base_local_planner
    wide, near = (f"move_base/{namespace_of(name)}" for name in planners)
    namespaces: dict[str, Any] = {
        "amcl": read.amcl,
        "move_base": read.move_base,
        "move_base/global_costmap": read.global_costmap,
        "move_base/local_costmap": read.local_costmap,
        wide: read.global_planner,
        near: read.local_planner,
        "move_base/rotate_recovery": read.rotate_recovery,
        "dispatcher": read.dispatcher,
    }
    models = read.global_planner, read.local_planner
    left_out = {*_NOT_ROS_PARAMETERS, *(name for model in models for name in model.without_effect)}
    return {
        namespace: {
            field.name: getattr(model, field.name)
            for field in dataclasses.fields(model)
            if field.name not in left_out | _written_names(sut, namespace)
        }
        for namespace, model in namespaces.items()
    }


def _written_names(sut: LoadedSut, namespace: str) -> set[str]:
    """Return the names written in a namespace, or in others where ROS looks for them."""
    spaces = [tuple(namespace.split("/"))]
    if namespace.endswith("rotate_recovery"):
        # rotate_recovery takes its speeds from there (rotate_recovery.cpp, initialize).
        spaces.append(("move_base", "TrajectoryPlannerROS"))
    names = {path[-1] for path in sut.settings if path[:-1] in spaces}
    if namespace.endswith("costmap"):
        from daemon.stacks.ros1.costmap.layers import SEARCHED_UPWARDS

        names |= {name for name in SEARCHED_UPWARDS if ("move_base", name) in sut.settings}
    return names


def _ros_values(read: RosParameters) -> dict[str, Any]:
    """Return topics, wiring, planners and costmaps of the ROS 1 stack."""
    return {
        "topics": dataclasses.asdict(read.topics),
        "wiring": {part: bool(lasers) for part, lasers in _wiring(read).items()},
        "planners": {
            "global": read.move_base.base_global_planner,
            "local": read.move_base.base_local_planner,
        },
        "costmaps": {
            "global_costmap": _costmap_values(read.global_costmap),
            "local_costmap": _costmap_values(read.local_costmap),
        },
    }


def _costmap_values(costmap: LayeredCostmap) -> dict[str, Any]:
    layers = [
        {"kind": _LAYER_KINDS[type(layer).__name__], **dataclasses.asdict(layer)}
        for layer in costmap.layers
    ]
    return {**dataclasses.asdict(costmap), "layers": layers}


def _wiring(read: RosParameters) -> dict[str, tuple[str, ...]]:
    """Return the lasers in the file that each part of the stack hears."""
    return dataclasses.asdict(read.topics.wire(read.topics.lasers()))


def _print_sut(sut: LoadedSut, read: RosParameters | None, value: ShownSut) -> None:
    reference = sut.reference
    about = f": {sut.layer.text.about}" if sut.layer.text.about else ""
    repeatable = "" if reference.repeatable else f", {NOT_REPEATABLE}"
    head = f"{reference.name}, kind {reference.kind}{repeatable}{about}"
    print_line(head)
    print_line(" < ".join(sut.layer.files), style="dim")
    _print_settings(stdout_console(), sut.settings, sut.findings.without_effect)
    # Files that travel with every run are not in the table of parameters.
    digests = [f"{name} (sha256 {digest[:12]})" for name, digest in reference.files.items()]
    if digests:
        print_line(f"\nfiles: {', '.join(digests)}")
    _print_defaults(value.defaults)
    if read is not None:
        _print_costmaps(value.ros)
        _print_wiring(read)
    report_findings(w for w in sut.warnings if w not in sut.idle)


def _print_settings(
    console: Console, settings: ParameterValues, idle: Iterable[ParameterFinding]
) -> None:
    """Print values with their places; ``idle`` ones have no effect, for a reason."""
    from rich.text import Text

    if not settings:
        return
    reasons = {one.path: one.message for one in idle}
    table = plain_table("parameter", "value", "written in", "without effect here")
    above = ""
    for path, setting in sorted(settings.items(), key=lambda item: (item[0][:-1], item[0])):
        namespace = "/".join(path[:-1])
        if namespace != above:
            table.add_row(Text(namespace, style="bold"))
            above = namespace
        where = f"{Path(setting.where.file).name}:{setting.where.line}"
        indent = "  " if namespace else ""
        cells = (f"{indent}{path[-1]}", _yaml_text(setting.value), where, reasons.get(path, ""))
        table.add_row(*(Text(cell) for cell in cells))
    console.print(table)


def _yaml_text(value: Any) -> str:
    """Return a value in YAML's notation."""
    if isinstance(value, bool):
        return str(value).lower()
    if value is None:
        return "not set"
    if isinstance(value, list):
        return json.dumps(value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _values_text(values: Mapping[str, Any]) -> str:
    """Return ``rate 5, recovery true`` in YAML's notation, without the name and the sources."""
    plain = {name: value for name, value in values.items() if name not in ("name", "sources")}
    return ", ".join(f"{name} {_yaml_text(value)}" for name, value in plain.items())


def _print_defaults(defaults: dict[str, dict[str, Any]]) -> None:
    if any(defaults.values()):
        print_line("\ndefaults, not written in any file", style="bold")
    for namespace, values in defaults.items():
        if values:
            print_line(f"  {namespace}: {_values_text(values)}")


def _print_costmaps(ros: dict[str, Any]) -> None:
    """Print the planners, and the layers of both costmaps from the lowest up."""
    print_line("\nplanners and costmaps", style="bold")
    print_line("  {global} plans, {local} drives".format_map(ros["planners"]))
    for name, costmap in ros["costmaps"].items():
        print_line(f"  {name} in {costmap['frame']}, {costmap['update_frequency']:g} Hz")
        for layer in costmap["layers"]:
            print_line(f"    {layer['name']}: {_values_text(layer)}")
            for source in layer.get("sources", ()):
                print_line(f"      {source['name']}: {_values_text(source)}")


def _print_wiring(read: RosParameters) -> None:
    """Print the topics of the lasers, and the listeners to them."""
    topics = read.topics
    print_line("\nlasers", style="bold")
    for laser in topics.lasers():
        print_line(f"  {laser or 'scan'} on {', '.join(topics.topics_of(laser, topics.lasers()))}")
    for part, lasers in _wiring(read).items():
        listens = getattr(topics, part)
        names = listens if isinstance(listens, str) else ", ".join(listens) or "nothing"
        hears = ", ".join(laser or "scan" for laser in lasers) or "no laser"
        style = "" if lasers else "yellow"
        print_line(f"  {part} listens to {names}: hears {hears}", style=style)
