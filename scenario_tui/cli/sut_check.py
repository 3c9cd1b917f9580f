"""The command that starts an external system under test and prints what it has and lacks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.completion import campaign_files, sut_files
from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.options import AsJson, check_folder
from scenario_tui.cli.output import (
    Output,
    report_findings,
    say,
    stderr_console,
    stdout_console,
)

if TYPE_CHECKING:
    from daemon.campaign import LoadedSut
    from daemon.model.sut import Briefing, Observation
    from daemon.stacks.ros2.inspection import CheckLine, Inspection
    from grammars.model.behaviour import Behaviour
    from grammars.model.mission import Mission
    from grammars.model.robot import Robot
    from grammars.model.scene import Scene
    from grammars.text.diagnostics import Finding

_KIND: Final = "ros2"
_SIGNS: Final = {
    "ok": ("pass", ""),
    "note": ("measure", ""),
    "warning": ("lost", "yellow"),
    "missing": ("fail", "bold red"),
}
"""The word whose glyph a line has, and the style of what it says."""
_ROOM: Final = 10.0
"""Width and depth of the room a stack is started in without a campaign [m]."""
_WALL: Final = 0.2


class InspectionOutput(Output, schema="inspection"):
    """What was seen of an external system that was started, against what a run needs.

    ``failure`` says why it could not be started at all, or did not get ready, and ``printed``
    holds the lines of its programs that tell most; ``lines`` are empty when there was nothing to
    look at. It took ``seconds`` of wall clock. ``outputs`` are files with all that was printed.
    """

    sut: str
    failure: str
    printed: tuple[str, ...]
    distribution: str
    rmw: str
    seconds: float
    lines: tuple[CheckLine, ...]
    outputs: tuple[str, ...]

    def print(self) -> None:
        """Print a line for each thing, and what to do where something is wrong."""
        from rich.text import Text

        from scenario_tui.text.formatting import GLYPHS, TERMINAL_STYLES, printed_lines

        console = stdout_console()
        width = max((len(line.subject) for line in self.lines), default=0)
        for line in self.lines:
            word, style = _SIGNS[line.state]
            text = Text.assemble(
                (GLYPHS[word], TERMINAL_STYLES[word]), f" {line.subject:<{width}}  "
            )
            facts = _facts(line)
            text.append(f"{facts}: " if facts else "", style="dim").append(line.text, style=style)
            if line.hint:
                text.append(f"\n{'':{width + 4}}→ {line.hint}")
            console.print(text, soft_wrap=True)
        telling_lines = printed_lines("\n".join(self.printed))
        if telling_lines:
            console.print("\nthe stack printed", style="dim")
        for printed in telling_lines:
            console.print(f"  {printed}", markup=False, soft_wrap=True)


def check(
    sut: Annotated[
        str,
        typer.Argument(
            metavar="SUT",
            help="A system under test that lives outside: its file, or its name as campaigns say.",
            autocompletion=completion.files(sut_files),
        ),
    ],
    campaign: Annotated[
        Path | None,
        typer.Option(
            "--campaign",
            metavar="FILE",
            help="Take robot, map and start of its first run. Default: an empty room.",
            autocompletion=completion.files(campaign_files),
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Where all that it prints goes. Default: scenario-results/sut-check/NAME/.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Start a ROS 2 stack, hold what is seen of it against what a run needs, and end it.

    No mission is sent. Leaves with 1 when something is missing, with 3 when it cannot be started.
    """
    from daemon.model.sut import SutFailure
    from daemon.stacks.ros2 import inspection
    from daemon.stacks.ros2.checkup import examine
    from daemon.stacks.ros2.settings import read_settings

    found = _load(sut, Path() if campaign is None else campaign.parent)
    settings = read_settings(found.reference.local_parameters)
    name = found.reference.name
    briefing, first = _first_moment(campaign, found.warnings)
    folder = Path("scenario-results", "sut-check", name) if out is None else out
    check_folder(folder, "--out")
    outputs: list[str] = []

    def write_outputs(printed: Mapping[str, bytes]) -> None:
        try:
            for file, data in printed.items():
                folder.mkdir(parents=True, exist_ok=True)
                (folder / file).write_bytes(data)
                outputs.append(str(folder / file))
        except OSError as error:
            say(f"its output cannot be written: {error}; name another folder with --out")

    say(f"starting {name}, which may take {settings.start_up:g} s")
    try:
        with _progress() as on_progress:
            seen = inspection.inspect_stack(settings, briefing, first, on_progress, write_outputs)
    except SutFailure as error:
        if as_json:
            nothing = InspectionOutput(
                name, error.reason, error.printed, "", "", 0.0, (), tuple(outputs)
            )
            nothing.emit()
        say(f"{name} cannot be started: {error}")
        _say_outputs(outputs)
        raise typer.Exit(ExitCode.INFRASTRUCTURE) from None
    lines = examine(settings, seen, briefing.robot.lasers)
    _output(name, seen, lines, tuple(outputs)).show(as_json)
    say(f"{name}: {_summary(lines)}")
    _say_outputs(outputs)
    if any(line.state == "missing" for line in lines):
        raise typer.Exit(ExitCode.UNEXPECTED)


def _say_outputs(outputs: list[str]) -> None:
    if outputs:
        say(f"all it printed: {', '.join(outputs)}")


def _output(
    name: str, seen: Inspection, lines: tuple[CheckLine, ...], outputs: tuple[str, ...]
) -> InspectionOutput:
    identity, failure = seen.identity, seen.failure
    return InspectionOutput(
        name,
        failure.reason if failure else "",
        failure.printed if failure else (),
        identity.distribution,
        identity.rmw,
        seen.seconds,
        lines,
        outputs,
    )


def _load(typed: str, folder: Path) -> LoadedSut:
    """Load a SUT file, or one that is found by its name as in a campaign of ``folder``.

    Raises :class:`InputError` for a bad file, and wrong usage for a system that is not outside.
    """
    from daemon.campaign import SUT, LayerLibrary, LayerReference, find_layer
    from grammars.text.diagnostics import Where

    path = Path(typed)
    if not path.is_file():
        path = find_layer(folder, LayerReference(typed, {}, Where(typed)), SUT)
    found = LayerLibrary(path.parent).sut_file(path)
    report_findings(found.warnings)
    if found.reference.kind != _KIND:
        raise typer.BadParameter(
            f"{found.reference.name} is of kind {found.reference.kind}: only systems of kind "
            f"{_KIND} can be started to be looked at",
            param_hint="SUT",
        )
    return found


def _first_moment(
    campaign: Path | None, reported: Sequence[Finding]
) -> tuple[Briefing, Observation]:
    """Return the briefing of a stack, and the first measurements of its robot.

    Warnings of the campaign are printed, except those that are ``reported`` already.
    """
    import numpy as np

    from daemon.model.spec import MapSettings
    from daemon.model.sut import Briefing, LaserScan, Observation
    from daemon.run_map import run_map
    from daemon.simulator import World

    if campaign is None:
        scene, robot, mission = _empty_room()
        behaviours: tuple[Behaviour, ...] = ()
        wanted = MapSettings(rule="outline")
    else:
        from scenario_tui.library.campaign import load

        loaded = load(campaign)
        submission = loaded.submission()
        report_findings(warning for warning in loaded.findings if warning not in reported)
        spec = submission.spec(submission.runs[0])
        scene = next(one for one in submission.scenes if one.digest == spec.scene)
        robot, mission, behaviours = spec.robot, spec.mission, spec.behaviours
        wanted = spec.map
    seed = np.random.SeedSequence(0)
    waypoints = tuple(waypoint.id for waypoint in mission.waypoints)
    world = World(scene, robot, mission.start, behaviours, seed, waypoints)
    joints = dict(zip(world.joint_names, world.joint_positions().tolist(), strict=True))
    grid = run_map(wanted, scene, robot.laser.z, joints)
    briefing = Briefing(robot, grid, mission, mission.start, seed)
    scans = tuple(LaserScan(0.0, world.scan(laser.name), laser.name) for laser in robot.lasers)
    return briefing, Observation(0.0, (world.odometry(0.0),), scans)


def _empty_room() -> tuple[Scene, Robot, Mission]:
    """Return a room without anything in it, the demo's robot, and a mission to stay there."""
    from importlib.resources import as_file, files

    from grammars.model.geometry import Pose2
    from grammars.model.mission import Mission, Waypoint
    from grammars.model.robot_files import load_robot
    from grammars.model.scene import Region, Scene, Solid

    half, outer = _ROOM / 2.0, _ROOM / 2.0 + _WALL
    sides = (
        (-outer, half, outer, outer),
        (-outer, -outer, outer, -half),
        (-outer, -half, -half, half),
        (half, -half, outer, half),
    )
    walls = [
        Solid(f"room-wall-{number}", "wall", _box(*corners), 0.0, 2.5)
        for number, corners in enumerate(sides, start=1)
    ]
    region = Region("room", _box(-half, -half, half, half))
    scene = Scene("room", (region,), (), tuple(walls), ())
    with as_file(files("campaigns")) as folder:
        robot = load_robot(folder / "robots" / "courier.yaml")
    return scene, robot, Mission("check", Pose2(), (Waypoint("here", 0.0, 0.0),))


def _box(x0: float, y0: float, x1: float, y1: float) -> tuple[tuple[float, float], ...]:
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


@contextmanager
def _progress() -> Iterator[Callable[[str], None]]:
    """Show what is waited for where somebody looks at it."""
    console = stderr_console()
    if not console.is_terminal:
        yield lambda _: None
        return
    from rich.text import Text

    with console.status("") as line:
        yield lambda waiting: line.update(Text(waiting))


def _facts(line: CheckLine) -> str:
    """Return type, quality of service and counts of a topic or an action."""
    from grammars.text.words import count_noun

    facts = [line.kind, line.qos]
    if line.publishers is not None and line.listeners is not None:
        facts += [count_noun(line.publishers, "publisher"), count_noun(line.listeners, "listener")]
    return ", ".join(filter(None, facts))


def _summary(lines: tuple[CheckLine, ...]) -> str:
    from grammars.text.words import count_noun

    count = Counter(line.state for line in lines)
    missing = f"{count['missing']} missing" if count["missing"] else "nothing is missing"
    warnings = f", {count_noun(count['warning'], 'warning')}" if count["warning"] else ""
    return f"{missing}{warnings}"
