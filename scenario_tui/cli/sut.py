"""Commands about a system under test: its parameters and their places; its check; its relay."""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenario_tui.cli import completion, sut_ros
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
    from collections.abc import Iterable

    from rich.console import Console

    from daemon.campaign import LoadedSut, ParameterValues
    from daemon.stacks.findings import ParameterFinding
    from daemon.stacks.ros1.configuration import RosParameters
    from scenario_tui.cli.values import ShownSut

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
        {} if read is None else sut_ros.described(read),
    )
    return Answer("sut", value, partial(_print_sut, sut, read, value.defaults))


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
    return {} if read is None else sut_ros.defaults(sut, read)


def _print_sut(
    sut: LoadedSut, read: RosParameters | None, defaults: dict[str, dict[str, Any]]
) -> None:
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
    _print_defaults(defaults)
    if read is not None:
        sut_ros.print_costmaps(read)
        sut_ros.print_wiring(read)
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


def _print_defaults(defaults: dict[str, dict[str, Any]]) -> None:
    if not any(defaults.values()):
        return
    print_line("\ndefaults, not written in any file", style="bold")
    for namespace, values in defaults.items():
        if values:
            listed = ", ".join(f"{name} {_yaml_text(value)}" for name, value in values.items())
            print_line(f"  {namespace}: {listed}")
