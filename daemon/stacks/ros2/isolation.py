"""Isolation of stacks from simultaneous ones, from the user's own, and from our Python.

A stack gets a ROS domain that is unique on the machine, its own folders, and an environment without
our private variables. A shell script makes this environment, on this machine and in a container
alike: the user's setup files first, then the variables of the SUT file, then those of isolation.
"""

from __future__ import annotations

import errno
import os
import random
import shlex
import socket
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final, TypeAlias

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.keys import OWN_PREFIX
from grammars.text.files import private_folder

OWN_DOMAINS: Final = range(1, 102)
"""Domain ids for stacks. Ports of higher ones lie in Linux' range of ephemeral ports (ROS 2
documentation, "The ROS_DOMAIN_ID"); 0 is the default of all other programs."""
_OURS: Final = ("PYTHONSAFEPATH", "PYTHONHOME", "__PYVENV_LAUNCHER__")
_THREADS: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_LONGEST_SOCKET: Final = 103
"""Longest path of a socket [bytes]; systems allow 103 or 107."""
_SPARE: Final = 60
"""Longest part of a socket's path after the runtime folder [bytes]."""
_LOCALHOST: Final = "ROS_LOCALHOST_ONLY"
_RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"

DomainLock: TypeAlias = tuple[int, socket.socket]
"""A ROS domain and its lock, a socket, which lasts until the last process with it closes it."""


class DomainTaken(SutFailure):
    """Another run uses the ROS domain that a SUT file requests."""


def runtime_folder() -> Path:
    """Return this user's private folder of running stacks; raises ``SutFailure``.

    It is among the temporary files. ``XDG_RUNTIME_DIR`` would be small, in memory, and gone when
    its user logs out, even while a daemon runs.
    """
    place = Path(tempfile.gettempdir())
    if len(os.fsencode(place)) + _SPARE > _LONGEST_SOCKET:
        place = Path("/tmp")
    try:
        own = private_folder(place / f"scenario-{os.getuid()}")
        return private_folder(own / "stacks")
    except OSError as error:
        raise SutFailure(
            f"no folder for a running stack: {error}; set TMPDIR to another one"
        ) from error


def lock_domain(requested: int | None) -> DomainLock:
    """Lock a ROS domain: ``requested``, or one of :data:`OWN_DOMAINS`.

    Raises :class:`DomainTaken` if ``requested`` is in use, ``SutFailure`` if all are.
    """
    # The lock is a name in the abstract namespace of Unix sockets. All users of a machine share
    # these names; they are exclusive, vanish with their holder, and leave no file that another user
    # could have made first. Like the ports of a domain they belong to the network namespace.
    # The choice is random, so that late messages of an ended stack do not reach a new one.
    chance = random.SystemRandom()
    own = chance.sample(OWN_DOMAINS, len(OWN_DOMAINS))
    for domain in own if requested is None else (requested,):
        holder = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            holder.bind(f"\0scenario-ros-domain-{domain}")
        except OSError as error:
            holder.close()
            if error.errno != errno.EADDRINUSE:
                raise
        else:
            return domain, holder
    if requested is None:
        raise SutFailure(f"all {len(OWN_DOMAINS)} ROS domains of this machine are in use")
    raise DomainTaken(
        f"ROS_DOMAIN_ID {requested} is in use by another run on this machine: "
        "with ROS_DOMAIN_ID: own each run gets a domain for itself"
    )


def without_ours(
    environ: Mapping[str, str], *, prefix: str = sys.prefix, base_prefix: str = sys.base_prefix
) -> dict[str, str]:
    """Return ``environ`` without our private variables.

    ``#!/usr/bin/env python3`` and the relay must find the Python of the stack's ROS, not the one
    of our virtual environment.
    """
    result = {name: value for name, value in environ.items() if not name.startswith(OWN_PREFIX)}
    for name in _OURS:
        result.pop(name, None)
    for name in _THREADS:
        # A worker sets them because runs are single threads; a stack may use more.
        if result.get(name) == "1":
            del result[name]
    if prefix != base_prefix:
        programs = Path(prefix) / "bin"
        folders = result.get("PATH", os.defpath).split(os.pathsep)
        others = [folder for folder in folders if folder and not _same(Path(folder), programs)]
        result["PATH"] = os.pathsep.join(others) or os.defpath
        if _same(Path(result.get("VIRTUAL_ENV", prefix)), Path(prefix)):
            result.pop("VIRTUAL_ENV", None)
            result.pop("VIRTUAL_ENV_PROMPT", None)
    return result


def _same(one: Path, other: Path) -> bool:
    return one == other or one.resolve() == other.resolve()


def isolating_variables(folder: Path, home: Path | None) -> dict[str, str]:
    """Return default variables of a stack and make the folders that they name.

    With the user's ``home``, packages installed by ``pip install --user`` stay available.
    """
    names = {"HOME": "home", "ROS_HOME": "ros", "ROS_LOG_DIR": "log", "TMPDIR": "tmp"}
    places = {variable: folder / name for variable, name in names.items()}
    for place in places.values():
        place.mkdir(mode=0o700, exist_ok=True)
    variables = {name: str(place) for name, place in places.items()}
    variables |= {
        "RCUTILS_COLORIZED_OUTPUT": "0",
        "RCUTILS_LOGGING_BUFFERED_STREAM": "0",
        "PYTHONUNBUFFERED": "1",
    }
    if home is not None and (home / ".local").is_dir():
        variables["PYTHONUSERBASE"] = str(home / ".local")
    return variables


def environment_script(
    setup: tuple[str, ...],
    variables: Mapping[str, str],
    isolation: Mapping[str, str],
    own: Mapping[str, str],
) -> str:
    """Return a shell script to source that makes the environment of a stack.

    It sources the files of ``setup`` in their order. Then it sets ``isolation``, the ``variables``
    of the SUT file, which override it, and ``own``, which overrides all. An error goes to standard
    error, in a line that begins with ``scenario:``, and ends the shell.
    """
    lines = [_SOURCING] if setup else []
    for file in setup:
        # This is the user's home folder; the stack's HOME is set later.
        home, path = ('"$HOME"/', file[2:]) if file.startswith("~/") else ("", file)
        lines.append(f"scenario_setup={home}{shlex.quote(path)}")
        lines.append(_SOURCE)
    if setup:
        # A setup file may switch on options that end shells at the first failing command.
        lines.append("trap - EXIT; set +eu; unset scenario_setup scenario_code")
    exported = {**isolation, **variables}
    lines += [f"export {name}={shlex.quote(value)}" for name, value in exported.items()]
    lines += _local_discovery(variables)
    lines += [f"export {name}={shlex.quote(value)}" for name, value in own.items()]
    return "\n".join(lines) + "\n"


# The trap reports a setup file that ends the shell; the line after it reports one that fails.
_SOURCING: Final = """\
scenario_refuse() { trap - EXIT; echo "scenario: $1" >&2; exit 1; }
trap 'scenario_code=$?
echo "scenario: the setup file $scenario_setup ended its shell, exit code $scenario_code" >&2
exit 1' EXIT"""
_SOURCE: Final = """\
[ -e "$scenario_setup" ] || scenario_refuse "there is no setup file $scenario_setup"
[ -r "$scenario_setup" ] || scenario_refuse "the setup file $scenario_setup cannot be read"
. "$scenario_setup"
scenario_code=$?
[ "$scenario_code" -eq 0 ] || scenario_refuse \\
    "the setup file $scenario_setup failed: its last command ended with code $scenario_code\""""


def _local_discovery(variables: Mapping[str, str]) -> list[str]:
    """Return lines that keep discovery on this machine, by the variables of the distribution.

    From Iron on ``ROS_LOCALHOST_ONLY`` is deprecated: it causes a warning and takes precedence.
    """
    if _LOCALHOST in variables or _RANGE in variables:
        return [f"unset {name}" for name in (_LOCALHOST, _RANGE) if name not in variables]
    return [
        'case "${ROS_DISTRO:-}" in',
        f"foxy|galactic|humble) export {_LOCALHOST}=1; unset {_RANGE} ;;",
        f"*) export {_RANGE}=LOCALHOST; unset {_LOCALHOST} ;;",
        "esac",
    ]
