"""Commands for the keys of a daemon and its clients: init, issue, list, bundle, revoke."""

from __future__ import annotations

import socket
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

import typer

from grammars.text.words import command_line
from scenario_tui.cli.answer import Answer
from scenario_tui.cli.commands import PlainFlagsGroup, command_of
from scenario_tui.cli.options import Keys, check_folder
from scenario_tui.cli.output import plain_table, say, stdout_console

if TYPE_CHECKING:
    from daemon.batch.security import IssuedKey, KeyList

app = typer.Typer(
    name="keys",
    help="Manage the keys by which machines authenticate each other.",
    no_args_is_help=True,
    add_completion=False,
    cls=PlainFlagsGroup,
)

Hosts: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--host",
        metavar="NAME",
        help="A name or address of the daemon; may be repeated. "
        "Default: this machine's name. Loopback is always included.",
    ),
]
Days: TypeAlias = Annotated[
    int, typer.Option(min=1, max=3650, help="Days for which a certificate is valid.")
]
KeyName: TypeAlias = Annotated[
    str, typer.Argument(metavar="KEY", help="Name of a key in `scenario keys list`.")
]


@command_of(app, "init")
def init(
    folder: Annotated[
        Path | None,
        typer.Argument(
            metavar="[DIR]", help="Folder of keys. Default: $SCENARIO_KEYS, then your settings."
        ),
    ] = None,
    host: Hosts = None,
    days: Days = 730,
) -> None:
    """Make an authority, and a key each for the daemon, a worker, an operator and a viewer.

    Existing files are never overwritten.
    """
    from daemon.batch.security import keys_folder
    from daemon.batch.security.authority import create_authority, utc_now

    place = keys_folder(folder)
    check_folder(place, "DIR")
    register = create_authority(place, _certificate_hosts(host), utc_now(), days)
    _print_keys(register.issued)
    words = ("--keys", folder) if folder else ()
    next_step = command_line("keys", "bundle", "worker", "-o", "worker.tar", *words)
    say(f"keys in {place}; next: `{next_step}` for another machine")


@command_of(app, "issue")
def issue(
    role: Annotated[
        Literal["viewer", "operator", "worker", "daemon"],
        typer.Argument(metavar="ROLE", help="Role of its owner."),
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of its owner: a-z, 0-9 and -.")],
    keys: Keys = None,
    host: Hosts = None,
    days: Days = 730,
) -> None:
    """Make one more key; the daemon admits it after its next start."""
    from daemon.batch.security import keys_folder
    from daemon.batch.security.authority import issue_key, utc_now
    from daemon.model.verbs import Role

    hosts = _certificate_hosts(host) if role == "daemon" else tuple(host or ())
    _print_keys((issue_key(keys_folder(keys), Role(role), name, hosts, utc_now(), days),))


@command_of(app, "list")
def list_(keys: Keys = None) -> Answer[KeyList]:
    """List all keys with role, last day and fingerprint."""
    from daemon.batch.security import KeyList, keys_folder, load_register

    place = keys_folder(keys)
    issued = load_register(place).issued
    return Answer("keys", KeyList(place, issued), partial(_print_keys, issued))


@command_of(app, "revoke")
def revoke(key: KeyName, keys: Keys = None) -> Answer[KeyList]:
    """Revoke a key; a running daemon refuses it within a second.

    Its earlier results still count: retry or delete those campaigns to run them again.
    """
    from daemon.batch.security import KeyList, keys_folder, load_register
    from daemon.batch.security.authority import revoke_key, utc_now

    place = keys_folder(keys)
    revoke_key(place, key, utc_now())
    revoked = tuple(one for one in load_register(place).issued if one.name == key)
    message = f'"{key}" is revoked'
    return Answer("keys", KeyList(place, revoked), partial(say, message))


@command_of(app, "bundle")
def bundle(
    key: KeyName,
    output: Annotated[Path, typer.Option("-o", metavar="FILE.tar", help="The archive to write.")],
    keys: Keys = None,
) -> None:
    """Pack a key for another machine; it is secret, so carry it safely (scp, a USB stick).

    Unpack it there: tar -xf FILE.tar -C ~/.config/scenario
    """
    from daemon.batch.security import keys_folder
    from daemon.batch.security.authority import pack_key

    pack_key(keys_folder(keys), key, output)
    say(f'"{key}" is in {output}: whoever has it is "{key}" for the daemon')


def _certificate_hosts(names: list[str] | None) -> tuple[str, ...]:
    # Without loopback, the daemon's own machine could not check its certificate.
    hosts = [*(names or [socket.gethostname()]), "localhost", "127.0.0.1", "::1"]
    return tuple(dict.fromkeys(hosts))


def _print_keys(issued: tuple[IssuedKey, ...]) -> None:
    table = plain_table("key", "role", "until", "fingerprint", "for")
    for one in issued:
        until = f"{datetime.fromtimestamp(one.expires_at, UTC):%Y-%m-%d}"
        end = until if one.revoked_at is None else "revoked"
        table.add_row(one.name, one.role, end, one.fingerprint[:16], " ".join(one.hosts))
    stdout_console().print(table)
