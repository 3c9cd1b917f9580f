"""Stacks in containers: the command of the engine, and the script inside.

Stack and relay share a container, so that they need no other network. The stack's folder, with the
relay's socket, is mounted at the same path. The tests use a script with the same options in the
place of an engine; no real engine has been tried.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.keys import Ros2Container
from daemon.supervision.remains import MARKER
from daemon.supervision.supervisor import ALARM, RELAY_EXIT

_ENGINE_LIMIT: Final = 30.0
"""Time limit for an engine to inspect an image [s]."""


def container_name(token: str) -> str:
    """Return the name of the container of a stack."""
    return f"scenario-{token}"


def find_engine(container: Ros2Container) -> str:
    """Return the path of the engine; raises ``SutFailure`` if it is not installed."""
    engine = shutil.which(container.engine)
    if engine is None:
        raise SutFailure(
            f"there is no {container.engine} on this machine to start {container.image} with"
        )
    return engine


def run_command(
    engine: str, container: Ros2Container, *, folder: Path, files: Iterable[Path], script: Path
) -> list[str]:
    """Return the command that runs ``script`` in a container with the stack's folder."""
    token = folder.name
    words = [engine, "run", "--rm", "--init", "--name", container_name(token)]
    words += ["--label", f"scenario={token}", "--network", container.network]
    words += ["--volume", f"{folder}:{folder}", "--workdir", str(folder)]
    for file in files:
        words += ["--volume", f"{file}:{file}:ro"]
    words += ["--env", f"{MARKER}={token}"]
    # The user inside must be ours outside. Otherwise the folder is closed to the stack, or only
    # root can remove its files. Podman's root is our user, docker's the machine's root.
    ours = container.engine == "docker" and os.getuid()
    words += ["--user", f"{os.getuid()}:{os.getgid()}" if ours else "0:0"]
    words += [*container.options, container.image]
    # Setup files need bash; an image without ROS, such as a test's, may lack it.
    choose = 'if command -v bash >/dev/null; then exec bash "$0"; else exec sh "$0"; fi'
    return [*words, "sh", "-c", choose, str(script)]


def image_command(engine: str, container: Ros2Container) -> str:
    """Return the image's own command, for a shell; raises ``SutFailure`` without one."""
    words = [engine, "image", "inspect", "--format", "{{json .Config.Cmd}}", container.image]
    try:
        result = subprocess.run(
            words,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_ENGINE_LIMIT,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise SutFailure(f"{container.engine} does not answer: {error}") from error
    if result.returncode:
        last_line = result.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
        raise SutFailure(
            f"{container.engine} knows no image {container.image} ({last_line}): fetch it with "
            f'"{container.engine} pull", or write "launch"'
        )
    try:
        command = json.loads(result.stdout)
    except ValueError:
        command = None
    if not isinstance(command, list) or not command:
        raise SutFailure(f'the image {container.image} has no command of its own: write "launch"')
    return shlex.join(map(str, command))


def container_script(
    environment: Path, launch: str, python: str, relay: Path, variables: dict[str, str]
) -> str:
    """Return the script that starts stack and relay; it ends with the stack and its exit code.

    The script sources ``environment`` first; ``variables`` are for the relay alone.
    """
    own = shlex.join([f"{name}={value}" for name, value in variables.items()])
    words = shlex.join([python, str(relay)])
    code = shlex.quote(str(environment.with_name(RELAY_EXIT)))
    over = shlex.quote(str(environment.with_name(f"{RELAY_EXIT}.none")))
    missing = shlex.quote(f"{ALARM}there is no {python} in the container for the relay")
    lines = [
        f". {shlex.quote(str(environment))}",
        # Job control gives the two their own groups, in which SIGINT is not ignored. Without it a
        # shell ignores SIGINT in background processes.
        "set -m",
        f"command -v {shlex.quote(python)} >/dev/null || {{ echo {missing} >&2; exit 127; }}",
        # The shell's message about a killed relay must not be among the last lines of the stack.
        f"( trap : INT TERM; exec 3>&2 2>/dev/null; env {own} {words} 2>&3 3>&-; scenario_code=$?",
        # A relay that ends because of the stack's end writes no exit code.
        f"  [ -e {over} ] || {{ echo $scenario_code > {code}.new; mv {code}.new {code}; }} ) &",
        "scenario_relay=$!",
        f'"${{BASH:-sh}}" -c {shlex.quote(launch)} &',
        "scenario_stack=$!",
        "scenario_tell() {",
        '    for scenario_job in "$scenario_stack" $scenario_relay; do',
        # The second form is for shells without job control outside of a terminal.
        '        kill "-$1" "-$scenario_job" 2>/dev/null || kill "-$1" "$scenario_job" 2>/dev/null',
        "    done",
        "}",
        "trap 'scenario_tell INT' INT",
        "trap 'scenario_tell TERM' TERM",
        # A signal ends the wait but not the job.
        'wait "$scenario_stack"; scenario_code=$?',
        'while kill -0 "$scenario_stack" 2>/dev/null; do',
        '    wait "$scenario_stack"; scenario_code=$?',
        "done",
        f": > {over}",
        "scenario_tell TERM",
        'exit "$scenario_code"',
    ]
    return "\n".join(lines) + "\n"
