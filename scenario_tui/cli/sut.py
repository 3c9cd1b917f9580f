"""Commands about a system under test: every parameter and where it comes from; its relay."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenario_tui.cli import completion, sut_ros
from scenario_tui.cli.commands import command_of
from scenario_tui.cli.completion import sut_files
from scenario_tui.cli.options import AsJson
from scenario_tui.cli.output import Output, plain_table, report_findings, stdout_console
from scenario_tui.cli.plain_flags import PlainFlagsGroup
from scenario_tui.cli.sut_check import check

if TYPE_CHECKING:
    from collections.abc import Iterable

    from daemon.campaign import LoadedSut, ParameterValues
    from daemon.stacks.findings import ParameterFinding
    from daemon.stacks.ros1.configuration import RosParameters
    from grammars.text.diagnostics import Finding


class _ShowsByDefault(PlainFlagsGroup):
    """A group in which a file in place of a command is shown."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take what is no command for arguments of ``show``."""
        if args and args[0] not in (*self.commands, *self.get_help_option_names(ctx)):
            args = ["show", *args]
        return super().parse_args(ctx, args)

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Offer commands, and the files that may stand in their place."""
        (file,) = (one for one in self.commands["show"].params if one.name == "file")
        return [*super().shell_complete(ctx, incomplete), *file.shell_complete(ctx, incomplete)]


app = typer.Typer(
    name="sut",
    cls=_ShowsByDefault,
    help="Show a system under test, or start an external one and see what it lacks.",
    epilog="`scenario sut SUT.yaml` is `scenario sut show SUT.yaml`.",
    no_args_is_help=True,
    add_completion=False,
    subcommand_metavar="SUT.yaml | COMMAND [ARGS]...",
)


class SutOutput(Output, schema="sut"):
    """A system under test; ``places`` says where each of its parameters was written.

    ``files`` are the SUT files it is made of, ``attached`` the digests of files that runs get.
    What only the ROS stack has is empty or null for others.
    """

    name: str
    kind: str
    files: tuple[str, ...]
    parameters: dict[str, Any]
    places: dict[str, str]
    defaults: dict[str, dict[str, Any]]
    topics: dict[str, Any] | None
    wiring: dict[str, bool] | None
    without_effect: dict[str, str]
    warnings: tuple[Finding, ...]
    planners: dict[str, str] | None = None
    costmaps: dict[str, dict[str, Any]] | None = None
    attached: dict[str, str] = dataclasses.field(default_factory=dict)

    @classmethod
    def of(cls, found: LoadedSut, read: RosParameters | None) -> SutOutput:
        """Return what was found in a file, and what the ROS stack reads there."""
        unused = found.findings.without_effect
        return cls(
            found.reference.name,
            found.reference.kind,
            found.layer.files,
            found.reference.parameters,
            {"/".join(path): str(s.where) for path, s in found.settings.items()},
            _all_defaults(found, read),
            None if read is None else dataclasses.asdict(read.topics),
            None if read is None else {k: bool(v) for k, v in sut_ros.wiring(read).items()},
            {"/".join(map(str, f.path)): f.message for f in unused},
            found.warnings,
            **({} if read is None else sut_ros.described(read)),
            attached=found.reference.files,
        )


@command_of(app, "show")
def show(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="SUT.yaml",
            help="A system under test: its file, or a name as campaigns say it.",
            autocompletion=completion.files(sut_files),
        ),
    ],
    as_json: AsJson = False,
) -> None:
    """Show a system under test: its parameters and where each was written.

    For the ROS stack also the defaults that apply, what has no effect here, the planners, the
    layers of both costmaps and who hears which laser; for a ROS 2 stack the defaults that apply.
    Nothing is started.
    """
    from daemon.campaign import SUT, LayerLibrary, LayerReference, RefusedSutError, find_layer
    from grammars.text.diagnostics import Where

    if not file.is_file() and not file.suffix:
        file = find_layer(Path(), LayerReference(str(file), {}, Where(str(file))), SUT)
    try:
        found = LayerLibrary(file.parent).sut_file(file)
    except RefusedSutError as refused:
        if not as_json:
            _print_given(refused.settings, ())
        raise
    read = _read_ros_parameters(found)
    if as_json:
        SutOutput.of(found, read).emit()
        return
    _print_head(found)
    _print_given(found.settings, found.findings.without_effect)
    _print_files(found)
    _print_defaults(_all_defaults(found, read))
    if read is not None:
        sut_ros.print_costmaps(read)
        sut_ros.print_quirks(read)
        sut_ros.print_wiring(read)
    report_findings(w for w in found.warnings if w not in found.idle)


command_of(app, "check")(check)


@command_of(app, "relay")
def relay() -> None:
    """Print the relay that talks to a ROS 2 stack, one file of Python, for building images.

    A run brings its own along; it must be inside of an image only where nothing can be mounted.
    """
    from importlib.resources import files

    # As a file and not as a module: it is written for the Python of the stack.
    sys.stdout.write(files("daemon.stacks.ros2").joinpath("relay.py").read_text("utf-8"))


def _read_ros_parameters(found: LoadedSut) -> RosParameters | None:
    from daemon.stacks.ros1 import ROS

    return ROS.read(found.reference.parameters) if found.reference.kind == ROS.name else None


def _all_defaults(found: LoadedSut, read: RosParameters | None) -> dict[str, dict[str, Any]]:
    """Return the values nobody wrote, by namespace or section, for kinds that tell them."""
    from daemon.stacks.ros2 import ROS2

    if found.reference.kind == ROS2.name:
        from daemon.stacks.ros2.settings import settings_not_written

        return settings_not_written(ROS2.read(found.reference.local_parameters))
    return {} if read is None else sut_ros.defaults(found, read)


def _print_head(found: LoadedSut) -> None:
    from scenario_tui.text.formatting import NOT_REPEATABLE

    reference = found.reference
    about = f": {found.layer.text.about}" if found.layer.text.about else ""
    repeatable = "" if reference.repeatable else f", {NOT_REPEATABLE}"
    stdout_console().print(
        f"{reference.name}, kind {reference.kind}{repeatable}{about}", markup=False, soft_wrap=True
    )
    stdout_console().print(" < ".join(found.layer.files), markup=False, style="dim", soft_wrap=True)


def _print_given(settings: ParameterValues, idle: Iterable[ParameterFinding]) -> None:
    """Print values with their places; ``idle`` are those without effect, with the reason."""
    from rich.text import Text

    if not settings:
        return
    reasons = {f.path: f.message for f in idle}
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
    stdout_console().print(table)


def _print_files(found: LoadedSut) -> None:
    """Print the files that travel with every run, which are no parameters of the table."""
    files = found.reference.files
    if files:
        listed = ", ".join(f"{name} (sha256 {digest[:12]})" for name, digest in files.items())
        stdout_console().print(f"\nfiles: {listed}", markup=False, soft_wrap=True)


def _yaml_text(value: Any) -> str:
    """Return a value as YAML would have it."""
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
    stdout_console().print("\nnot written anywhere", style="bold")
    for namespace, values in defaults.items():
        if values:
            listed = ", ".join(f"{name} {_yaml_text(value)}" for name, value in values.items())
            stdout_console().print(f"  {namespace}: {listed}", markup=False, soft_wrap=True)
