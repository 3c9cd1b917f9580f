"""What a command is about: the daemon its options name, and a campaign or a run there."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.batch.errors import Refused, Unreachable
from grammars.text.diagnostics import Finding, InputError, Where, did_you_mean

if TYPE_CHECKING:
    from daemon.batch.paths import StatePaths
    from daemon.model.status import CampaignRow, RunDetail
    from daemon.model.verbs import CampaignSource, DaemonClient

_NONE_YET: Final = "there are no campaigns yet: submit one with `scenario submit CAMPAIGN.yaml`"


@dataclass(frozen=True, slots=True)
class DaemonTarget:
    """The daemon a command is about, as told by its options."""

    connect: str = ""
    state: Path | None = None

    @property
    def endpoint(self) -> str:
        """Where the daemon listens as far as known now; it may move when it restarts.

        Raises :class:`Unreachable` for a state directory somebody chose that no
        daemon keeps: there is no need to look for its socket. Raises
        :class:`InputError` when the environment names what is no endpoint.
        """
        from daemon.batch.paths import StatePaths, find_endpoint, is_endpoint

        found = find_endpoint(self.connect, self.state)
        if found.origin == "SCENARIO_CONNECT" and not is_endpoint(found.address):
            message = f"{found.address!r} is not an endpoint"
            hint = "write tcp/<host>:<port> or tls/<host>:<port>"
            raise InputError(Finding(Where(found.origin), message, hint))
        if found.origin == "default" and (self.state or os.environ.get("SCENARIO_STATE")):
            folder = StatePaths.find(self.state).state
            raise Unreachable(
                f"no daemon keeps {folder}: start one with `scenario daemon` or `scenario submit`"
            )
        return found.address

    @property
    def paths(self) -> StatePaths:
        """The state directory of this machine that is meant."""
        from daemon.batch.paths import StatePaths

        return StatePaths.find(self.state)

    @property
    def named(self) -> bool:
        """Whether people said which daemon: then none is started behind their back."""
        from daemon.batch.paths import find_endpoint

        return find_endpoint(self.connect, self.state).origin in ("--connect", "SCENARIO_CONNECT")

    @property
    def words(self) -> tuple[str, ...]:
        """The options that mean this daemon."""
        state = ("--state", str(self.state)) if self.state is not None else ()
        return (*(("--connect", self.connect) if self.connect else ()), *state)

    @property
    def may_come_back(self) -> bool:
        """Whether there is a daemon that is only away: one that was named, or has left a ledger."""
        return self.named or self.paths.ledger.exists()

    @contextmanager
    def open(self) -> Iterator[DaemonClient]:
        """Open a client; raises :class:`Unreachable`."""
        from daemon.batch.client import Client

        with Client.open(self.endpoint) as client:
            yield client


def find_run(source: CampaignSource, wanted: str) -> RunDetail:
    """Return the run meant by its id, or by a campaign as :func:`find_campaign` and its number.

    Raises :class:`Refused` when there is none, with what there is.
    """
    name, dot, number = wanted.rpartition(".")
    # The id as it is costs one question; only what is none needs the list of campaigns.
    try:
        return source.run(wanted)
    except Refused:
        campaign = find_campaign(source, name if dot else wanted)
    meant = f"{campaign.id}.{number}"
    if dot and meant != wanted:
        with suppress(Refused):
            return source.run(meant)
    last = f"{campaign.id}.{campaign.total - 1}"
    raise Refused(f'"{wanted}" is no run: those of {campaign.id} are {campaign.id}.0 to {last}')


def find_campaign(source: CampaignSource, wanted: str) -> CampaignRow:
    """Return the campaign meant by an id, a name (the newest of it) or their beginning.

    Without a word it is the newest. Raises :class:`Refused` when there is none or
    when several different names begin that way.
    """
    # An id beats a name and both beat a beginning, so that what is said in full is never doubtful.
    # Asked one by one: there may be thousands of campaigns, and each of these finds a few.
    if not wanted:
        newest = source.campaign_page(limit=1)
        if newest:
            return newest[0]
        raise Refused(_NONE_YET)
    exact = source.campaign_page(id=wanted, limit=1)
    exact = exact or source.campaign_page(name=wanted, limit=1)
    if exact:
        return exact[0]
    # Ids begin with the name: several campaigns of one name are no doubt, the newest is meant.
    close = source.campaign_page(beginning=wanted)
    if len({row.name for row in close}) > 1:
        ids = ", ".join(row.id for row in close[:5])
        raise Refused(f'several campaigns begin with "{wanted}": {ids}')
    if close:
        return close[0]
    if name := _name_in_file(wanted):
        raise Refused(f'{wanted} is a file: what was submitted of it is called "{name}"')
    rows = source.campaign_page()
    if not rows:
        raise Refused(_NONE_YET)
    names = {row.name for row in rows} | {row.id for row in rows}
    raise Refused(f'there is no campaign "{wanted}": {did_you_mean(wanted, names)}')


def _name_in_file(path: str) -> str:
    """Return how a campaign file calls its campaign, empty for what is none."""
    from scenario_tui.campaign_files import is_campaign

    file = Path(path)
    if not is_campaign(file):
        return ""
    found = re.search(r"^campaign\s*:\s*([\w-]+)", file.read_text("utf-8", "replace"), re.MULTILINE)
    return found[1] if found else ""


def find_campaign_or_search(source: CampaignSource, wanted: str) -> CampaignRow:
    """Return the campaign meant as :func:`find_campaign` does, a search also by its own name.

    That is what its campaign file calls it; the newest of that name is meant. Raises
    :class:`Refused` when there is neither.
    """
    try:
        return find_campaign(source, wanted)
    except Refused:
        # Searches are asked for only when no campaign is meant.
        called = [row for row in source.searches() if row.task.name == wanted]
        found = source.campaign_page(id=called[0].campaign, limit=1) if called else ()
        if not found:
            raise
        return found[0]
