"""The command that runs the world of a scenario live, for people and for stacks."""

from __future__ import annotations

import shlex
import signal
import threading
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Final

import typer

from grammars.text.plugins import install_command
from grammars.text.words import count_noun
from scenario_tui.cli.answer import CommandError, ExitCode
from scenario_tui.cli.options import CampaignFile
from scenario_tui.cli.output import report_findings, say
from scenario_tui.terminal.capabilities import why_no_screen

if TYPE_CHECKING:
    from daemon.live.foxglove_server import FoxgloveServer
    from daemon.live.ros_bridge import RosBridge
    from daemon.live.simulation import LiveSimulation, LiveThread
    from daemon.model.spec import RunSpec
    from daemon.model.sut import SystemUnderTest
    from grammars.model.scene import Scene

_LOOPBACK: Final = frozenset({"127.0.0.1", "localhost", "::1"})
_LOOK: Final = 0.5
"""Seconds between two looks for news."""
_NOBODY: Final = "nobody"
"""Name of the system under test if none drives."""


@dataclass(slots=True)
class _Servers:
    """Services of a live world; ``lacking`` names a missing one, and the reason.

    The command ``to_type`` connects a stack to the bridge; its map server reads ``map_file``, if
    any.
    """

    foxglove: FoxgloveServer | None = None
    bridge: RosBridge | None = None
    to_type: str = ""
    map_file: str = ""
    lacking: str = ""

    def lines(self) -> list[str]:
        """Return lines with addresses and connections; the last one is the command to type."""
        lines = [self.lacking] if self.lacking else []
        if self.foxglove is not None:
            count = self.foxglove.clients
            clients = count_noun(count, "client") if count else "no client"
            lines.append(f"Foxglove {_url(self.foxglove)}  {clients}")
        if self.bridge is not None:
            lines.append(f"ROS 2 {self.bridge.state}")
            if self.map_file:
                lines.append(f"map for the stack: {self.map_file}")
            if not self.bridge.connected:
                lines += ["type this in a terminal of the stack's ROS 2:", self.to_type]
        return lines


def serve(
    campaign: CampaignFile,
    scenario: Annotated[
        str, typer.Option("-s", metavar="NAME", help="Default: the first of the file.")
    ] = "",
    sut: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="System under test that drives while nobody else does; with --ros2 one of "
            "kind ros2, for its topics and frames.",
        ),
    ] = "",
    repeat: Annotated[
        int, typer.Option(min=0, help="Repeat that sets noise and drawn behaviours.")
    ] = 0,
    speed: Annotated[
        float, typer.Option(min=0.01, max=1000.0, help="Simulated seconds per second.")
    ] = 1.0,
    foxglove: Annotated[
        bool | None,
        typer.Option(
            "--foxglove/--no-foxglove",
            help="Serve Foxglove's WebSocket protocol. Default: if its SDK is installed.",
        ),
    ] = None,
    host: Annotated[str, "Address that Foxglove connects to."] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Its port; 0 takes a free one.")
    ] = 8765,
    ros2: Annotated[bool, "Accept a ROS 2 stack that you start by hand."] = False,
    socket: Annotated[
        str,
        typer.Option(
            metavar="PATH|tcp://127.0.0.1:PORT",
            help="With --ros2: address for the relay of the stack. Default: a temporary folder.",
        ),
    ] = "",
    headless: Annotated[bool, "Print addresses only; no view, no keys."] = False,
) -> int | None:
    """Run the world of a scenario live: drive in it, watch it, connect a stack to it.

    Use it to develop a stack before you test it. The topics are those of a trace; the world
    records and judges nothing, and waits for nobody. Ctrl-C or q ends it.
    """
    from daemon.live.simulation import LiveSimulation
    from daemon.run import load_kernels

    if socket and not ros2:
        raise typer.BadParameter("needs --ros2", param_hint="--socket")
    spec, scene = _pick(campaign, scenario, sut, repeat)
    if not spec.sut.repeatable and not ros2:
        raise typer.BadParameter(
            f"{sut} is an external stack: start it by hand, and connect it with --ros2",
            param_hint="--sut",
        )
    # Before the clock starts: otherwise the world would report that it cannot keep up.
    load_kernels(spec, scene)
    simulation = LiveSimulation(spec, scene, speed=speed, sut=_maker(spec))
    code = 0
    with ExitStack() as stack:
        services = _Servers()
        if foxglove is not False:
            _serve_foxglove(services, simulation, host, port, is_required=bool(foxglove))
        if services.foxglove is not None:
            stack.enter_context(closing(services.foxglove))
        if ros2:
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="scenario-")))
            bridge = _serve_ros(services, simulation, socket or f"{folder}/relay", folder)
            stack.enter_context(closing(bridge))
        with simulation.running() as thread:
            if headless or why_no_screen():
                _serve_headless(simulation, services, thread)
            else:
                from scenario_tui.dashboard.screens.live import LiveScreen
                from scenario_tui.dashboard.screens.standalone import run_alone

                screen = LiveScreen(simulation, thread, services.lines, services.to_type)
                code = run_alone(screen)
        for one in (thread, services.bridge):
            if one is not None and one.failure is not None:
                raise one.failure
    return ExitCode.BUG if code else None


def _url(foxglove: FoxgloveServer) -> str:
    host = foxglove.host
    if host in ("0.0.0.0", "::"):
        from socket import gethostname

        host = gethostname()
    return f"ws://{f'[{host}]' if ':' in host else host}:{foxglove.port}"


def _pick(path: Path, scenario: str, sut: str, repeat: int) -> tuple[RunSpec, Scene]:
    """Return the chosen run and its scene."""
    from daemon.model.spec import SutReference
    from scenario_tui.library.campaign import load

    campaign = load(path)
    campaign = campaign.select(scenario or campaign.scenarios[0], sut)
    submission = campaign.submission()
    report_findings(campaign.findings)
    runs = tuple(map(submission.spec, (*submission.runs, *submission.reserve)))
    spec = next((run for run in runs if run.repeat == repeat), None)
    if spec is None:
        last = max(run.repeat for run in runs)
        message = f"{runs[0].scenario} has repeats 0 to {last}"
        raise typer.BadParameter(message, param_hint="--repeat")
    if not sut:
        # All systems of a scenario share their random numbers, so any run has its world.
        spec = replace(spec, sut=SutReference(_NOBODY, "idle", {}))
    return spec, next(scene for scene in submission.scenes if scene.digest == spec.scene)


def _maker(spec: RunSpec) -> Callable[[], SystemUnderTest] | None:
    """Return a function that makes the system under test, ``None`` without one."""
    from daemon.stacks.registry import make_sut

    if spec.sut.name == _NOBODY or not spec.sut.repeatable:
        return None
    return partial(make_sut, spec.sut.kind, spec.sut.local_parameters)


def _serve_foxglove(
    services: _Servers, simulation: LiveSimulation, host: str, port: int, *, is_required: bool
) -> None:
    try:
        from daemon.live.foxglove_server import FoxgloveServer, OutletError
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0] != "foxglove":
            raise
        command = install_command("foxglove")
        no_sdk = f"Foxglove needs its SDK: {command} (or turn it off: --no-foxglove)"
        if is_required:
            raise CommandError(no_sdk, ExitCode.INFRASTRUCTURE) from error
        services.lacking = no_sdk
        return
    if host not in _LOOPBACK:
        say(
            f"warning: whoever reaches this machine at {host} can watch and drive: the protocol "
            "has no passwords. Safer: leave --host out, and ssh -L 8765:127.0.0.1:8765 to it"
        )
    try:
        services.foxglove = FoxgloveServer(simulation, host=host, port=port)
    except OutletError as error:
        message = f"{error}; --port 0 takes a free port, --no-foxglove turns it off"
        raise CommandError(message, ExitCode.INFRASTRUCTURE) from error


def _serve_ros(
    services: _Servers, simulation: LiveSimulation, socket: str, folder: Path
) -> RosBridge:
    """Listen for the relay of a stack; its files go to ``folder``."""
    import secrets

    from daemon.live.ros_bridge import RosBridge, usual_settings
    from daemon.stacks.ros2 import ROS2
    from daemon.stacks.ros2.link import LinkLost, RelayLink, relay_path

    sut, nonce = simulation.spec.sut, secrets.token_hex(8)
    is_ros2 = sut.kind == ROS2.name
    settings = ROS2.read(sut.local_parameters) if is_ros2 else usual_settings()
    if settings.map == "file":
        services.map_file = _write_map(simulation, folder)
    try:
        first = [RelayLink.listen(socket, nonce)]
        # The next stack connects to the same address, also if the port was a free one.
        address = first[0].address
        services.bridge = bridge = RosBridge(
            simulation, lambda: first.pop() if first else RelayLink.listen(address, nonce), settings
        )
    except LinkLost as error:
        raise CommandError(str(error), ExitCode.INFRASTRUCTURE) from error
    variables = f"SCENARIO_SOCKET={shlex.quote(address)} SCENARIO_NONCE={nonce}"
    services.to_type = f"{variables} python3 {shlex.quote(str(relay_path()))}"
    return bridge


def _write_map(simulation: LiveSimulation, folder: Path) -> str:
    """Write the map of a world that a run would get; return the path of its ``map.yaml``."""
    from daemon.run_map import run_map
    from grammars.model.behaviour import start_positions
    from grammars.model.map_files import write_map

    spec, scene = simulation.spec, simulation.scene
    height = spec.robot.laser.z
    grid = run_map(spec.map, scene, height, start_positions(scene, spec.behaviours))
    return str(write_map(grid, folder / "map", laser_height=height)[1])


def _serve_headless(simulation: LiveSimulation, services: _Servers, thread: LiveThread) -> None:
    """Print the addresses, then changes, until the end."""
    # SIGINT and SIGTERM are the normal end. They set an event, because Python loses the exception
    # of a signal where it cannot propagate, such as in the callback of a weak reference.
    ended = threading.Event()
    endings = (signal.SIGINT, signal.SIGTERM)
    handlers = [signal.signal(number, lambda *_: ended.set()) for number in endings]
    try:
        previous = services.lines()
        for line in (*previous, "Ctrl-C ends it"):
            say(line)
        while thread.is_alive() and not ended.wait(_LOOK):
            status = simulation.status
            lines = services.lines()
            lines += [f"cannot keep up with {status.speed:g}x"] if status.late else []
            lines += [status.note] if status.note else []
            for line in lines:
                if line not in previous:
                    say(line)
            previous = lines
        if ended.is_set():
            say("\nthe world has ended")
    finally:
        for number, handler in zip(endings, handlers, strict=True):
            signal.signal(number, handler)
