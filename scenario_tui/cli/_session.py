"""Reaching a daemon from a command: where it is, opening a client, finding a campaign."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from daemon.errors import Refused, Unreachable
from daemon.protocol import CampaignRow, RunDetail
from grammars.diagnostics import Diagnostic, InputError, Where, did_you_mean
from scenario_tui.asking import Daemon

if TYPE_CHECKING:
    from daemon.places import Places


@dataclass(frozen=True, slots=True)
class Target:
    """The daemon a command is about, as told by its options."""

    connect: str = ""
    state: Path | None = None

    @property
    def endpoint(self) -> str:
        """Where the daemon listens as far as known now; it may move when it restarts.

        Raises :class:`daemon.errors.Unreachable` for a state directory somebody chose that no
        daemon keeps: there is no need to look for its socket. Raises
        :class:`InputError` when the environment names what is no endpoint.
        """
        from daemon.places import Places, find_endpoint, is_endpoint

        found = find_endpoint(self.connect, self.state)
        if found.origin == "SCENARIO_CONNECT" and not is_endpoint(found.address):
            message = f"{found.address!r} is not an endpoint"
            hint = "write tcp/<host>:<port> or tls/<host>:<port>"
            raise InputError(Diagnostic(Where(found.origin), message, hint))
        if found.origin == "default" and (self.state or os.environ.get("SCENARIO_STATE")):
            folder = Places.find(self.state).state
            raise Unreachable(
                f"no daemon keeps {folder}: start one with `scenario daemon` or `scenario submit`"
            )
        return found.address

    @property
    def places(self) -> Places:
        """The state directory of this machine that is meant."""
        from daemon.places import Places

        return Places.find(self.state)

    @property
    def named(self) -> bool:
        """Whether people said which daemon: then none is started behind their back."""
        from daemon.places import find_endpoint

        return find_endpoint(self.connect, self.state).origin in ("--connect", "SCENARIO_CONNECT")

    @contextmanager
    def open(self) -> Iterator[Daemon]:
        """Open a client; raises :class:`daemon.errors.Unreachable`."""
        from daemon.client import Client

        with Client.open(self.endpoint) as client:
            yield client


class Campaigns(Protocol):
    """Whoever knows the campaigns: a daemon, or the ledger itself."""

    def campaigns(self) -> tuple[CampaignRow, ...]:
        """All campaigns, the newest first."""


class Runs(Campaigns, Protocol):
    """Whoever knows the runs as well."""

    def run(self, run: str, /) -> RunDetail:
        """Everything about one run; raises :class:`daemon.errors.Refused` for an unknown id."""


def find_run(daemon: Runs, wanted: str) -> RunDetail:
    """Return the run meant by its id, or by a campaign as :func:`find_campaign` and its number.

    Raises :class:`daemon.errors.Refused` when there is none, with what there is.
    """
    name, dot, number = wanted.rpartition(".")
    try:
        return daemon.run(wanted)
    except Refused:
        campaign = find_campaign(daemon, name if dot else wanted)
    meant = f"{campaign.id}.{number}"
    if dot and meant != wanted:
        with suppress(Refused):
            return daemon.run(meant)
    last = f"{campaign.id}.{campaign.total - 1}"
    raise Refused(f'"{wanted}" is no run: those of {campaign.id} are {campaign.id}.0 to {last}')


def find_campaign(daemon: Campaigns, wanted: str) -> CampaignRow:
    """Return the campaign meant by an id, a name (the newest of it) or their beginning.

    Without a word it is the newest. Raises :class:`daemon.errors.Refused` when there is none or
    when several different names begin that way.
    """
    rows = daemon.campaigns()
    if not rows:
        raise Refused("there are no campaigns yet: submit one with `scenario submit CAMPAIGN.yaml`")
    if not wanted:
        return rows[0]
    for key in ("id", "name"):
        for row in rows:
            if getattr(row, key) == wanted:
                return row
    close = [row for row in rows if row.id.startswith(wanted)]
    if len({row.name for row in close}) > 1:
        ids = ", ".join(row.id for row in close[:5])
        raise Refused(f'several campaigns begin with "{wanted}": {ids}')
    if close:
        return close[0]
    names = {row.name for row in rows} | {row.id for row in rows}
    raise Refused(f'there is no campaign "{wanted}": {did_you_mean(wanted, names)}')
