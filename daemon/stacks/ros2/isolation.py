"""Separation of stacks: from those that run at the same time, the user's own, and our Python.

A stack gets a ROS domain that nobody else on the machine has, folders of its own, and an
environment without what belongs to us alone. Its environment is made by a shell script, the same
one for a stack of this machine and one in a container: the user's setup files first, then the
variables of the SUT file, then what isolates it.
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
"""Domain ids handed out. Ports of higher ones lie in Linux' range of ephemeral ports (ROS 2
documentation, "The ROS_DOMAIN_ID"); 0 is everybody's who has chosen none."""
_OURS: Final = ("PYTHONSAFEPATH", "PYTHONHOME", "__PYVENV_LAUNCHER__")
_THREADS: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_LONGEST_SOCKET: Final = 103
"""Bytes of a socket's path: systems take 103 or 107."""
_SPARE: Final = 60
"""Bytes that come after the runtime folder in the path of a socket."""
_LOCALHOST: Final = "ROS_LOCALHOST_ONLY"
_RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"


DomainLock: TypeAlias = tuple[int, socket.socket]
"""A ROS domain and what holds it: until the last process that has the socket closes it or dies."""


class DomainTaken(SutFailure):
    """The ROS domain that a SUT file asks for is another run's, at the moment."""


def runtime_folder() -> Path:
    """Return this user's folder of running stacks, private; raises ``SutFailure``.

    With the temporary files and not in ``XDG_RUNTIME_DIR``: that is small, in memory, and gone
    when its user logs out, also under a daemon that goes on.
    """
    place = Path(tempfile.gettempdir())
    if len(os.fsencode(place)) + _SPARE > _LONGEST_SOCKET:
        place = Path("/tmp")
    try:
        own = private_folder(place / f"scenario-{os.getuid()}")
        return private_folder(own / "stacks")
    except OSError as error:
        raise SutFailure(
            f"no folder for a running stack: {error}; name another one by TMPDIR"
        ) from error


def lock_domain(wanted: int | None) -> DomainLock:
    """Lock a ROS domain: ``wanted``, or one of :data:`OWN_DOMAINS`.

    Raises :class:`DomainTaken` when ``wanted`` is, ``SutFailure`` when all are.
    """
    # A name in the abstract namespace of Unix sockets, never listened to: all users of a machine
    # share these, they are as exclusive as a lock, gone with their holder, and leave no file that
    # another user of the machine could have made first. They are those of the network namespace,
    # and so are the ports of a domain.
    # At random, not the lowest: what still finds its way from a stack that ended this moment
    # should not find one that has just begun.
    chance = random.SystemRandom()
    own = chance.sample(OWN_DOMAINS, len(OWN_DOMAINS))
    for domain in own if wanted is None else (wanted,):
        holder = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            holder.bind(f"\0scenario-ros-domain-{domain}")
        except OSError as error:
            holder.close()
            if error.errno != errno.EADDRINUSE:
                raise
        else:
            return domain, holder
    if wanted is None:
        raise SutFailure(f"all {len(OWN_DOMAINS)} ROS domains of this machine are in use")
    raise DomainTaken(
        f"ROS_DOMAIN_ID {wanted} is in use by another run on this machine: "
        "with ROS_DOMAIN_ID: own each run gets a domain for itself"
    )


def without_ours(
    environ: Mapping[str, str], *, prefix: str = sys.prefix, base_prefix: str = sys.base_prefix
) -> dict[str, str]:
    """Return ``environ`` without what is there for us alone.

    ``#!/usr/bin/env python3`` and the relay must find the Python of the stack's ROS, not the one
    of a virtual environment that we are installed in.
    """
    kept = {name: value for name, value in environ.items() if not name.startswith(OWN_PREFIX)}
    for name in _OURS:
        kept.pop(name, None)
    for name in _THREADS:
        # A worker sets them, for runs are one thread each; a stack has as many as it likes.
        if kept.get(name) == "1":
            del kept[name]
    if prefix != base_prefix:
        programs = Path(prefix) / "bin"
        folders = kept.get("PATH", os.defpath).split(os.pathsep)
        left = [folder for folder in folders if folder and not _same(Path(folder), programs)]
        kept["PATH"] = os.pathsep.join(left) or os.defpath
        if _same(Path(kept.get("VIRTUAL_ENV", prefix)), Path(prefix)):
            kept.pop("VIRTUAL_ENV", None)
            kept.pop("VIRTUAL_ENV_PROMPT", None)
    return kept


def _same(one: Path, other: Path) -> bool:
    return one == other or one.resolve() == other.resolve()


def isolating_variables(folder: Path, home: Path | None) -> dict[str, str]:
    """Return what a stack gets unless its SUT file says otherwise; makes the folders it names.

    ``home`` is the user's: packages that were installed with ``pip install --user`` stay in sight.
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
    """Return a shell script, to be sourced, that makes the environment of a stack.

    Files of ``setup`` are sourced in their order; then come ``isolation``, the ``variables`` of
    the SUT file, which win over it, and ``own``, which wins over all. What is wrong it says on
    standard error, in a line that begins with ``scenario:``, and ends the shell.
    """
    lines = [_SOURCING] if setup else []
    for file in setup:
        # Below the user's own home folder: that of the stack comes afterwards.
        home, path = ('"$HOME"/', file[2:]) if file.startswith("~/") else ("", file)
        lines.append(f"scenario_setup={home}{shlex.quote(path)}")
        lines.append(_SOURCE)
    if setup:
        # What a setup file switched on ends shells at the first command that fails.
        lines.append("trap - EXIT; set +eu; unset scenario_setup scenario_code")
    exported = {**isolation, **variables}
    lines += [f"export {name}={shlex.quote(value)}" for name, value in exported.items()]
    lines += _local_discovery(variables)
    lines += [f"export {name}={shlex.quote(value)}" for name, value in own.items()]
    return "\n".join(lines) + "\n"


# A setup file that ends the shell itself is named by the trap; one that fails, by the line after.
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
    """Return lines that keep discovery on this machine, in the words of the distribution.

    From Iron on ``ROS_LOCALHOST_ONLY`` is out of date: setting it is warned about, and it wins.
    """
    if _LOCALHOST in variables or _RANGE in variables:
        return [f"unset {name}" for name in (_LOCALHOST, _RANGE) if name not in variables]
    return [
        'case "${ROS_DISTRO:-}" in',
        f"foxy|galactic|humble) export {_LOCALHOST}=1; unset {_RANGE} ;;",
        f"*) export {_RANGE}=LOCALHOST; unset {_LOCALHOST} ;;",
        "esac",
    ]
