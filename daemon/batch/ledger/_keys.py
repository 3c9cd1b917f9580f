"""Keys in the ledger: what each has brought, how much it may hold, and voiding what one brought."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from typing import Final

from daemon.batch.errors import Refused
from daemon.batch.ledger._leases import LeaseUpdates
from daemon.batch.ledger._results import remove_result
from daemon.batch.ledger.transitions import Released, Voided
from daemon.model.status import CampaignDeliveries, KeyDeliveries

_SPARE_LEASES: Final = 64
"""Leases a worker may hold beyond two for each slot: of results that wait to be delivered."""
MOST_LEASES: Final = 4096
"""Leases a key may hold, however many slots its workers say they have."""
_SLICE: Final = 256
"""Runs that are voided in one transaction: some ten milliseconds."""


class KeyUpdates(LeaseUpdates):
    """What the ledger does about keys; ``holder`` is a key's name, empty for the daemon's owner."""

    def check_trusted(self, holder: str) -> None:
        """Refuse a key whose results do not count."""
        if self._db.execute("SELECT 1 FROM void_key WHERE name = ?", (holder,)).fetchone():
            raise Refused(f'what the key "{holder}" brings was voided: use another key')

    def room_for_leases(self, worker: str, holder: str, slots: tuple[int, int]) -> int:
        """Return how many more leases a worker may get, so that no key empties the queue.

        ``slots`` are the worker's, and those of all workers of its key: two leases for each and
        some more. Slots are what workers say: a key begins with few leases and gets two more with
        every result it has brought. The owner's workers are bounded one by one only.
        """
        own, together = slots
        room = 2 * own + _SPARE_LEASES - self._running("worker = ?", worker)
        if holder:
            most = _SPARE_LEASES + 2 * min(together, self._brought(holder))
            # Whose leases they are takes a look at each: not where all together are few enough.
            if self._running() + room > most:
                room = min(room, most - self._held_leases(holder))
        return max(0, room)

    def _running(self, condition: str = "TRUE", *values: str) -> int:
        # Without being told, SQLite reads the rows of all that is running.
        found = self._db.execute(
            "SELECT count(*) FROM run INDEXED BY run_working"
            f" WHERE state = 'running' AND {condition}",
            values,
        ).fetchone()
        return int(found[0])

    def _brought(self, holder: str) -> int:
        """Return how many results a key has brought, as far as it matters for its leases."""
        found = self._db.execute(
            "SELECT count(*) FROM (SELECT 1 FROM result WHERE holder = ? LIMIT ?)",
            (holder, (MOST_LEASES - _SPARE_LEASES) // 2),
        ).fetchone()
        return int(found[0])

    def _held_leases(self, holder: str) -> int:
        found = self._db.execute(
            "SELECT count(*) FROM run JOIN lease ON lease.token = run.token"
            " WHERE state = 'running' AND lease.holder = ?",
            (holder,),
        ).fetchone()
        return int(found[0])

    def void_key(self, holder: str, now: float) -> Iterator[tuple[str, ...]]:
        """Let nothing count that a key has brought: its runs are queued again.

        Done part by part, each part within a transaction of the caller's; each gives for its runs
        the names of the traces that the caller removes before it commits, empty for a run that had
        its result from another one and so no trace of its own. From the first on
        nothing is taken from the key and nothing it brought is used again. Doing it once more goes
        on where it ended.
        """
        self._db.execute("INSERT OR IGNORE INTO void_key VALUES (?, ?)", (holder, now))
        held = self._db.execute(
            "SELECT run.id, run.token FROM run JOIN lease ON lease.token = run.token"
            " WHERE state = 'running' AND lease.holder = ?",
            (holder,),
        ).fetchall()
        for run, token in held:
            self._apply(run, Released(token, _void_reason(holder), blame=False), now)
            # No setback of the run's: it need not wait for another worker.
            self._db.execute("UPDATE run SET not_before = 0, setbacks = 0 WHERE id = ?", (run,))
        yield ()
        while True:
            # Results taken from the key's keep its name, so that they are found here as well.
            rows = self._db.execute(
                "SELECT id, campaign, trace_name, cached FROM result JOIN run ON run.id = run"
                " WHERE holder = ? LIMIT ?",
                (holder, _SLICE),
            ).fetchall()
            if not rows:
                return
            for run, campaign, _, cached in rows:
                self._void_run(run, campaign, holder, now, cached=bool(cached))
            for campaign in dict.fromkeys(row[1] for row in rows):
                self._reopen(campaign, holder, now)
            yield tuple("" if row[3] else row[2] for row in rows)

    def _void_run(self, run: str, campaign: str, holder: str, now: float, *, cached: bool) -> None:
        self._apply(run, Voided(_void_reason(holder)), now, quiet=True)
        remove_result(self._db, run)
        if cached:
            self._db.execute("UPDATE run SET cached = '' WHERE id = ?", (run,))
            self._db.execute("UPDATE campaign SET cached = cached - 1 WHERE id = ?", (campaign,))

    def _reopen(self, campaign: str, holder: str, now: float) -> None:
        self._db.execute("UPDATE campaign SET finished_at = NULL WHERE id = ?", (campaign,))
        reason = _void_reason(holder)
        self.record_event(now, "campaign", campaign, campaign, "retried", reason)


def _void_reason(holder: str) -> str:
    return f'what the key "{holder}" brought was voided'


def read_deliveries(db: sqlite3.Connection, holder: str) -> KeyDeliveries:
    """Return what a key has brought, by campaign in the order of submission."""
    rows = db.execute(
        "SELECT campaign.id, campaign.name, count(*), sum(run.cached <> ''), min(at), max(at)"
        " FROM result JOIN run ON run.id = result.run JOIN campaign ON campaign.id = run.campaign"
        " WHERE holder = ? GROUP BY campaign.serial ORDER BY campaign.serial",
        (holder,),
    )
    campaigns = tuple(CampaignDeliveries(*row) for row in rows)
    held = db.execute(
        "SELECT count(*) FROM run JOIN lease ON lease.token = run.token"
        " WHERE state = 'running' AND lease.holder = ?",
        (holder,),
    ).fetchone()
    void = db.execute("SELECT at FROM void_key WHERE name = ?", (holder,)).fetchone()
    return KeyDeliveries(holder, campaigns, held[0], None if void is None else void[0])
