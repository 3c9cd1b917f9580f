"""Commands about a system under test: its parameters and their places; its check; its relay."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections import Counter
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from grammars.text.diagnostics import Finding, Where
from grammars.text.words import count_noun
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, ExitCode
from scenario_tui.cli.commands import PlainFlagsGroup, command_of
from scenario_tui.cli.options import out_folder
from scenario_tui.cli.output import (
    open_progress,
    plain_table,
    print_line,
    report_findings,
    say,
    stderr_console,
    stdout_console,
)
from scenario_tui.text.formatting import NOT_REPEATABLE, printed_lines
from scenario_tui.text.styles import GLYPHS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rich.console import Console

    from daemon.campaign import LoadedSut, ParameterValues
    from daemon.model.sut import Briefing, Observation
    from daemon.stacks.findings import ParameterFinding
    from daemon.stacks.ros1.configuration import RosParameters
    from daemon.stacks.ros1.costmap.layers import LayeredCostmap
    from daemon.stacks.ros2.checkup import StackCheck
    from daemon.stacks.ros2.inspection import CheckLine
    from scenario_tui.cli.values import ShownSut

_NOT_ROS_PARAMETERS: Final = frozenset({"layers", "frame", "recovery_behaviors"})
"""Fields of the models that are no parameters, or have no default to show."""
_LAYER_KINDS: Final = {
    "StaticLayer": "map",
    "ObstacleLayer": "obstacles",
    "VoxelLayer": "obstacles",
    "InflationLayer": "inflation",
}
_CHECKED_KIND: Final = "ros2"
_SIGNS: Final = {
    "ok": (GLYPHS["pass"], "pass", ""),
    "note": (GLYPHS["measure"], "measure", ""),
    "warning": ("!", "inconclusive", "yellow"),
    "missing": (GLYPHS["fail"], "fail", "bold red"),
}
"""The sign of a line by its state, its style, and the style of the text."""


class _SutGroup(PlainFlagsGroup):
    """A group in which a file in place of a command is shown."""

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Return the name and the command of ``args``, and the rest of them."""
        is_file = args[0].endswith((".yaml", ".yml"))
        return super().resolve_command(ctx, ["show", *args] if is_file else args)


app = typer.Typer(
    name="sut",
    cls=_SutGroup,
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
        sut = _load_sut(file, Path())
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


@command_of(app, "check")
def check(
    sut: Annotated[
        str,
        typer.Argument(
            metavar="SUT",
            help="An external system under test: its file, or its name in campaigns.",
            autocompletion=completion.offers(completion.sut_files),
        ),
    ],
    campaign: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Use robot, map and start of its first run. Default: an empty room.",
            autocompletion=completion.offers(completion.campaign_files),
        ),
    ] = None,
    out: Annotated[
        Path | None,
        out_folder("Folder for its output. Default: scenario-results/sut-check/NAME/."),
    ] = None,
) -> Answer[StackCheck]:
    """Start a ROS 2 stack, compare it with the needs of a run, and end it.

    No mission is sent. Exits with 1 if something is missing, with 3 if the stack does not start.
    """
    from daemon.model.sut import SutFailure
    from daemon.stacks.ros2 import inspection
    from daemon.stacks.ros2.checkup import StackCheck, examine
    from daemon.stacks.ros2.settings import read_settings

    loaded = _load_sut(sut, Path() if campaign is None else campaign.parent)
    report_findings(loaded.warnings)
    name, kind = loaded.reference.name, loaded.reference.kind
    if kind != _CHECKED_KIND:
        only = f"only systems of kind {_CHECKED_KIND} can be checked"
        raise typer.BadParameter(f"{name} is of kind {kind}: {only}", param_hint="SUT")
    settings = read_settings(loaded.reference.local_parameters)
    briefing, first = _first_moment(campaign, loaded.warnings)
    folder = Path("scenario-results", "sut-check", name) if out is None else out
    outputs: list[str] = []

    def write_outputs(printed: Mapping[str, bytes]) -> None:
        try:
            for file, data in printed.items():
                folder.mkdir(parents=True, exist_ok=True)
                (folder / file).write_bytes(data)
                outputs.append(str(folder / file))
        except OSError as error:
            say(f"its output cannot be written: {error}; choose another folder with --out")

    say(f"starting {name}, which may take {settings.start_up:g} s")
    try:
        with open_progress("{task.description}") as progress:
            task = progress.add_task("")

            def show(waiting: str) -> None:
                progress.update(task, description=waiting)

            stack = inspection.inspect_stack(settings, briefing, first, show, write_outputs)
    except SutFailure as error:
        value = StackCheck(name, error.reason, error.printed, outputs=tuple(outputs))
        return Answer("inspection", value, partial(_print_failure, value), ExitCode.INFRASTRUCTURE)
    lines = examine(settings, stack, briefing.robot.lasers)
    value = StackCheck(
        name,
        stack.failure.reason if stack.failure else "",
        stack.failure.printed if stack.failure else (),
        stack.identity.distribution,
        stack.identity.rmw,
        stack.seconds,
        lines,
        tuple(outputs),
    )
    lacks = any(line.state == "missing" for line in lines)
    code = ExitCode.UNEXPECTED if lacks else ExitCode.EXPECTED
    return Answer("inspection", value, partial(_print_check, value), code)


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


def _load_sut(name: str, folder: Path) -> LoadedSut:
    """Load a SUT file by its path, or by its name in a campaign of ``folder``.

    Raises :class:`InputError`.
    """
    from daemon.campaign import SUT, LayerLibrary, LayerReference, find_layer

    path = Path(name)
    if not path.is_file():
        path = find_layer(folder, LayerReference(name, {}, Where(name)), SUT)
    return LayerLibrary(path.parent).sut_file(path)


def _first_moment(
    campaign: Path | None, reported: Sequence[Finding]
) -> tuple[Briefing, Observation]:
    """Return the briefing of a stack, and the first measurements of its robot.

    The default campaign is the empty room that ships. Prints warnings of the campaign, except
    those already ``reported``.
    """
    import numpy as np

    from daemon.model.sut import Briefing, LaserScan, Observation
    from daemon.run_map import run_map
    from daemon.simulator import World
    from grammars.text.sources import shipped_folder
    from scenario_tui.library.campaign import load

    loaded = load(campaign or shipped_folder() / "empty_room" / "campaign.yaml")
    submission = loaded.submission()
    report_findings(warning for warning in loaded.findings if warning not in reported)
    spec = submission.spec(submission.runs[0])
    scene = next(one for one in submission.scenes if one.digest == spec.scene)
    robot, mission = spec.robot, spec.mission
    seed = np.random.SeedSequence(0)
    waypoints = tuple(waypoint.id for waypoint in mission.waypoints)
    world = World(scene, robot, mission.start, spec.behaviours, seed, waypoints)
    joints = dict(zip(world.joint_names, world.joint_positions().tolist(), strict=True))
    grid = run_map(spec.map, scene, robot.laser.z, joints)
    briefing = Briefing(robot, grid, mission, mission.start, seed)
    scans = tuple(LaserScan(0.0, world.scan(laser.name), laser.name) for laser in robot.lasers)
    return briefing, Observation(0.0, (world.odometry(0.0),), scans)


def _print_failure(check: StackCheck) -> None:
    reason = "\n".join([check.failure, *(f"  {line}" for line in check.printed)])
    say(f"{check.sut} cannot be started: {reason}")
    _say_outputs(check)


def _print_check(check: StackCheck) -> None:
    """Print a line for each item, with a hint if something is wrong."""
    from rich.text import Text

    width = max((len(line.subject) for line in check.lines), default=0)
    for line in check.lines:
        sign, sign_style, style = _SIGNS[line.state]
        text = Text.assemble((sign, sign_style), f" {line.subject:<{width}}  ")
        facts = _facts(line)
        text.append(f"{facts}: " if facts else "", style="dim").append(line.text, style=style)
        if line.hint:
            text.append(f"\n{'':{width + 4}}→ {line.hint}")
        print_line(text)
    printed = printed_lines("\n".join(check.printed))
    if printed:
        print_line("\nthe stack printed", style="dim")
    for output in printed:
        print_line(f"  {output}")
    count = Counter(line.state for line in check.lines)
    missing = f"{count['missing']} missing" if count["missing"] else "nothing is missing"
    warnings = f", {count_noun(count['warning'], 'warning')}" if count["warning"] else ""
    say(f"{check.sut}: {missing}{warnings}")
    _say_outputs(check)


def _facts(line: CheckLine) -> str:
    """Return type, quality of service and counts of a topic or an action."""
    facts = [line.kind, line.qos]
    if line.publishers is not None and line.listeners is not None:
        facts += [count_noun(line.publishers, "publisher"), count_noun(line.listeners, "listener")]
    return ", ".join(filter(None, facts))


def _say_outputs(check: StackCheck) -> None:
    if check.outputs:
        say(f"all of its output: {', '.join(check.outputs)}")
