"""The command that starts an external system under test and compares it with its needs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from grammars.text.diagnostics import Finding, Where
from grammars.text.words import count_noun
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, ExitCode
from scenario_tui.cli.options import out_folder
from scenario_tui.cli.output import open_progress, print_line, report_findings, say
from scenario_tui.text.formatting import printed_lines
from scenario_tui.text.styles import GLYPHS

if TYPE_CHECKING:
    from daemon.campaign import LoadedSut
    from daemon.model.sut import Briefing, Observation
    from daemon.stacks.ros2.checkup import StackCheck
    from daemon.stacks.ros2.inspection import CheckLine

_KIND: Final = "ros2"
_SIGNS: Final = {
    "ok": (GLYPHS["pass"], "pass", ""),
    "note": (GLYPHS["measure"], "measure", ""),
    "warning": ("!", "inconclusive", "yellow"),
    "missing": (GLYPHS["fail"], "fail", "bold red"),
}
"""The sign of a line by its state, its style, and the style of the text."""


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

    loaded = load_sut(sut, Path() if campaign is None else campaign.parent)
    report_findings(loaded.warnings)
    name, kind = loaded.reference.name, loaded.reference.kind
    if kind != _KIND:
        only = f"only systems of kind {_KIND} can be checked"
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


def load_sut(name: str, folder: Path) -> LoadedSut:
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
