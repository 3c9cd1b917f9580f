"""The command that lets a scenario's world go on by the clock, for people and for stacks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli.exit_codes import ExitCode, wrong_usage
from scenario_tui.cli.options import CampaignFile
from scenario_tui.cli.output import report_findings, say

if TYPE_CHECKING:
    from daemon.live.foxglove_server import FoxgloveServer
    from daemon.live.ros_bridge import RosBridge
    from daemon.live.simulation import LiveSimulation, LiveThread
    from daemon.model.spec import RunSpec
    from daemon.model.submission import Submission
    from daemon.model.sut import SystemUnderTest
    from daemon.stacks.ros2.settings import Ros2Settings
    from grammars.model.scene import Scene

_LOOPBACK: Final = frozenset({"127.0.0.1", "localhost", "::1"})
_LOOK: Final = 0.5
"""Seconds between two looks at whether there is anything to tell."""
_NOBODY: Final = "nobody"
"""What stands for a system under test where none drives."""
_NO_SDK: Final = (
    "Foxglove needs its SDK: pip install 'scenario-tui[foxglove]' (or leave it out: --no-foxglove)"
)


def serve(
    campaign: CampaignFile,
    scenario: Annotated[
        str,
        typer.Option("--scenario", "-s", metavar="NAME", help="Default: the first of the file."),
    ] = "",
    sut: Annotated[
        str,
        typer.Option(
            "--sut",
            metavar="NAME",
            help="A system under test that drives while nobody else does; with --ros2 one of "
            "kind ros2, for its topics and frames.",
        ),
    ] = "",
    repeat: Annotated[
        int, typer.Option("--repeat", min=0, help="Which repeat: noise and drawn behaviours.")
    ] = 0,
    speed: Annotated[
        float, typer.Option("--speed", help="Simulated seconds a second, 0.01 to 1000.")
    ] = 1.0,
    foxglove: Annotated[
        bool | None,
        typer.Option(
            "--foxglove/--no-foxglove",
            help="Serve Foxglove's WebSocket protocol. Default: if its SDK is installed.",
        ),
    ] = None,
    host: Annotated[
        str, typer.Option("--host", help="Address that Foxglove connects to.")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Its port; 0 takes a free one.")
    ] = 8765,
    ros2: Annotated[
        bool,
        typer.Option("--ros2", help="Let a ROS 2 stack connect that you start by hand."),
    ] = False,
    socket: Annotated[
        str,
        typer.Option(
            "--socket",
            metavar="PATH|tcp://127.0.0.1:PORT",
            help="Where its relay connects to; goes with --ros2. Default: in a folder of its own.",
        ),
    ] = "",
    headless: Annotated[
        bool, typer.Option("--headless", help="Print where it is served; no view, no keys.")
    ] = False,
) -> None:  # fmt: skip
    """Let a scenario's world go on by the clock: drive in it, look at it, connect a stack to it.

    The topics are those of a trace. Nothing is recorded or judged, and nobody is waited for: it
    is for developing a stack before testing it. Ctrl-C or q ends it.
    """
    from daemon.live.simulation import LiveSimulation, check_speed
    from daemon.run import load_kernels

    with wrong_usage("--speed"):
        check_speed(speed)
    if socket and not ros2:
        raise typer.BadParameter("goes with --ros2", param_hint="--socket")
    spec, scene = _pick(campaign, scenario, sut, repeat)
    if not spec.sut.repeatable and not ros2:
        raise typer.BadParameter(
            f"{sut} lives outside: start it by hand, and let it connect with --ros2",
            param_hint="--sut",
        )
    # Before the clock counts: a world that stutters at its start would say it cannot keep up.
    load_kernels(spec, scene)
    simulation = LiveSimulation(spec, scene, speed=speed, sut=_maker(spec))
    with _served(simulation, foxglove, host, port, socket if ros2 else None) as services:
        with simulation.running() as thread:
            if headless or _why_no_view():
                _serve_headless(simulation, services, thread)
            else:
                _serve_in_view(simulation, services, thread)
        bridge = services.bridge
        for failure in (thread.failure, bridge.failure if bridge is not None else None):
            if failure is not None:
                raise failure


@dataclass(frozen=True, slots=True)
class LiveServices:
    """By what a world can be reached.

    ``to_type`` connects a stack, whose map server is to read ``map_file``, if any.
    """

    foxglove: FoxgloveServer | None = None
    bridge: RosBridge | None = None
    to_type: str = ""
    map_file: str = ""
    without: str = ""

    def where(self) -> list[str]:
        """Say where it is served, a line each; the line to type is the last one."""
        lines = [self.without] if self.without else []
        if self.foxglove is not None:
            lines.append(f"Foxglove: open a connection to {self._url()}")
        if self.map_file:
            lines.append(f"ROS 2: start your stack with this map: {self.map_file}")
        if self.bridge is not None:
            lines += ["ROS 2: type this in a terminal of the stack's ROS 2:", self.to_type]
        return lines

    def who(self) -> list[str]:
        """Say who is connected, a line each."""
        from grammars.text.words import count_noun

        lines = [self.without] if self.without else []
        if self.foxglove is not None:
            count = self.foxglove.clients
            said = count_noun(count, "client") if count else "nobody listens"
            lines.append(f"Foxglove {self._url()}  {said}")
        if self.bridge is not None:
            lines.append(f"ROS 2 {self.bridge.state}")
            if self.map_file:
                lines.append(f"map for the stack: {self.map_file}")
            if not self.bridge.connected:
                lines.append(self.to_type)
        return lines

    def _url(self) -> str:
        assert self.foxglove is not None
        host = self.foxglove.host
        if host in ("0.0.0.0", "::"):
            from socket import gethostname

            host = gethostname()
        return f"ws://{f'[{host}]' if ':' in host else host}:{self.foxglove.port}"


def _pick(path: Path, scenario: str, sut: str, repeat: int) -> tuple[RunSpec, Scene]:
    """Return the run that is meant, and its scene."""
    from daemon.model.spec import SutReference
    from scenario_tui.library.campaign import load

    campaign = load(path)
    submission = campaign.submission()
    report_findings(campaign.findings)
    runs = tuple(map(submission.spec, (*submission.runs, *submission.reserve)))
    found = _matching(runs, scenario, sut, repeat)
    if not sut:
        # Chance is the same for all systems of a scenario, so any of its runs is its world.
        found = replace(found, sut=SutReference(_NOBODY, "idle", {}))
    return found, _scene(submission, found)


def _matching(runs: Sequence[RunSpec], scenario: str, sut: str, repeat: int) -> RunSpec:
    """Return the run of that scenario, system and repeat; say what there is otherwise."""
    from grammars.text.diagnostics import did_you_mean

    scenarios = list(dict.fromkeys(run.scenario for run in runs))
    name = scenario or scenarios[0]
    if name not in scenarios:
        hint = did_you_mean(name, scenarios)
        raise typer.BadParameter(f'no scenario "{name}": {hint}', param_hint="--scenario")
    runs = [run for run in runs if run.scenario == name]
    suts = list(dict.fromkeys(run.sut.name for run in runs))
    if sut and sut not in suts:
        hint = did_you_mean(sut, suts)
        raise typer.BadParameter(f'{name} has no "{sut}": {hint}', param_hint="--sut")
    runs = [run for run in runs if run.sut.name == (sut or suts[0])]
    for run in runs:
        if run.repeat == repeat:
            return run
    raise typer.BadParameter(
        f"{name} has repeats 0 to {max(run.repeat for run in runs)}", param_hint="--repeat"
    )


def _scene(submission: Submission, spec: RunSpec) -> Scene:
    return next(scene for scene in submission.scenes if scene.digest == spec.scene)


def _maker(spec: RunSpec) -> Callable[[], SystemUnderTest] | None:
    """Return what makes the system that drives, or nothing where nobody does."""
    from functools import partial

    from daemon.stacks.registry import make_sut

    if spec.sut.name == _NOBODY or not spec.sut.repeatable:
        return None
    return partial(make_sut, spec.sut.kind, spec.sut.local_parameters)


@contextmanager
def _served(
    simulation: LiveSimulation, foxglove: bool | None, host: str, port: int, socket: str | None
) -> Iterator[LiveServices]:
    """Serve a simulation as long as the context lasts; ``socket`` is empty for one of its own."""
    services = LiveServices()
    with ExitStack() as stack:
        if foxglove is not False:
            services = _with_foxglove(services, simulation, host, port, wanted=bool(foxglove))
        if services.foxglove is not None:
            stack.callback(services.foxglove.close)
        if socket is not None:
            from tempfile import TemporaryDirectory

            folder = stack.enter_context(TemporaryDirectory(prefix="scenario-"))
            services = _with_bridge(services, simulation, socket or f"{folder}/relay", Path(folder))
            assert services.bridge is not None
            stack.callback(services.bridge.close)
        yield services


def _with_foxglove(
    services: LiveServices, simulation: LiveSimulation, host: str, port: int, *, wanted: bool
) -> LiveServices:
    try:
        from daemon.live.foxglove_server import FoxgloveServer, OutletError
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0] != "foxglove":
            raise
        if wanted:
            say(f"scenario: {_NO_SDK}")
            raise typer.Exit(ExitCode.INFRASTRUCTURE) from error
        return replace(services, without=_NO_SDK)
    if host not in _LOOPBACK:
        say(
            f"warning: whoever reaches this machine at {host} can watch and drive: the protocol "
            "knows no passwords. Safer: leave --host out, and ssh -L 8765:127.0.0.1:8765 to it"
        )
    try:
        return replace(services, foxglove=FoxgloveServer(simulation, host=host, port=port))
    except OutletError as error:
        say(f"scenario: {error}; --port 0 takes a free port, --no-foxglove does without")
        raise typer.Exit(ExitCode.INFRASTRUCTURE) from error


def _with_bridge(
    services: LiveServices, simulation: LiveSimulation, socket: str, folder: Path
) -> LiveServices:
    import secrets
    import shlex

    from daemon.live.ros_bridge import RosBridge
    from daemon.stacks.ros2.link import LinkLost
    from daemon.stacks.ros2.relay_link import RelayLink, relay_path

    nonce, settings = secrets.token_hex(8), _settings(simulation.spec)
    map_file = _write_map(simulation, folder) if settings.map == "file" else ""
    try:
        first = [RelayLink.listen(socket, nonce)]
        # Of a port that was free: the next stack finds it where the first one did.
        address = first[0].address
        bridge = RosBridge(
            simulation,
            lambda: first.pop() if first else RelayLink.listen(address, nonce),
            settings,
        )
    except LinkLost as error:
        say(f"scenario: {error}")
        raise typer.Exit(ExitCode.INFRASTRUCTURE) from error
    script = shlex.quote(str(relay_path()))
    variables = f"SCENARIO_SOCKET={shlex.quote(address)} SCENARIO_NONCE={nonce}"
    to_type = f"{variables} python3 {script}"
    return replace(services, bridge=bridge, to_type=to_type, map_file=map_file)


def _write_map(simulation: LiveSimulation, folder: Path) -> str:
    """Write the map of a world as a run has it; return the path of its ``map.yaml``."""
    from daemon.run_map import run_map
    from grammars.model.behaviour import start_positions
    from grammars.model.map_files import write_map

    spec, scene = simulation.spec, simulation.scene
    height = spec.robot.laser.z
    grid = run_map(spec.map, scene, height, start_positions(scene, spec.behaviours))
    return str(write_map(grid, folder / "map", laser_height=height)[1])


def _settings(spec: RunSpec) -> Ros2Settings:
    """Return the names of the stack that was named, else the usual ones."""
    from daemon.live.ros_bridge import usual_settings
    from daemon.stacks.ros2 import ROS2

    return ROS2.read(spec.sut.local_parameters) if spec.sut.kind == ROS2.name else usual_settings()


def _why_no_view() -> str:
    """Say why there can be no view here, empty when there can."""
    import sys

    from scenario_tui.terminal.capabilities import why_undrawable

    # Drawn on standard error like the dashboard, with keys from standard input.
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return "no terminal"
    return why_undrawable()


def _serve_headless(simulation: LiveSimulation, services: LiveServices, thread: LiveThread) -> None:
    """Say where it is served, then what changes, until the end."""
    import signal
    import threading

    # Told to end or interrupted: both are the way this ends, and nothing is lost. An event, as an
    # exception raised by a signal is lost where Python cannot pass it on (in a weak reference's
    # callback, say).
    ended = threading.Event()
    endings = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda *_: ended.set()) for number in endings]
    try:
        for line in services.where():
            say(line)
        say("Ctrl-C ends it")
        told: tuple[str, ...] = ()
        while thread.is_alive() and not ended.wait(_LOOK):
            news = _news(simulation, services)
            for line in news:
                if line not in told:
                    say(line)
            told = news
        if ended.is_set():
            say("\nthe world has ended")
    finally:
        for number, handler in zip(endings, before, strict=True):
            signal.signal(number, handler)


def _news(simulation: LiveSimulation, services: LiveServices) -> tuple[str, ...]:
    """Return what is to be told when it was not so before."""
    status = simulation.status
    found = [f"cannot keep up with {status.speed:g}x"] if status.late else []
    if services.bridge is not None:
        found.append(f"ROS 2 {services.bridge.state}")
    return (*found, *([status.note] if status.note else ()))


def _serve_in_view(simulation: LiveSimulation, services: LiveServices, thread: LiveThread) -> None:
    """Show it until somebody leaves."""
    from scenario_tui.dashboard.screens.live import LiveScreen, run_live

    code = run_live(LiveScreen(simulation, thread, services.who, services.to_type))
    if code:
        raise typer.Exit(ExitCode.BUG)
