"""The doctor's checks of what lies on disk: keys, the ledger, what something killed left behind.

Each finding is one line, with the remedy. Nothing is changed; locks are tried for a moment, shared.
"""

from __future__ import annotations

import fcntl
import shlex
import stat
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError, KeysUnusable
from daemon.batch.ledger import SCHEMA_VERSION, LedgerIntegrity, LedgerReader, check_integrity
from daemon.batch.paths import StatePaths
from daemon.batch.security import IssuedKey, find_credentials, is_authority, load_register
from daemon.model.ids import is_id
from daemon.model.verbs import Role

_EXPIRES_SOON: Final = 30 * 86_400.0
_RENEWAL: Final = "`scenario keys issue {role} NAME` makes another, `scenario keys bundle` packs it"
# Seconds: a clock that is being disciplined may be a little behind what it said before.
_LEDGER_SKEW: Final = 5.0
_BACKUP: Final = (
    "stop the daemon, keep a copy of the directory, restore the ledger from a backup "
    "or save what is readable with `sqlite3 ledger.db .recover`"
)
_SHOWN: Final = 3


class FindingLevel(StrEnum):
    """How a finding is to be taken; a problem keeps runs from being executed or kept safe."""

    OK = "ok"
    WARNING = "warning"
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class DoctorFinding:
    """``subject`` is what was looked at, ``remedy`` what to do, empty when all is well."""

    level: FindingLevel
    subject: str
    message: str
    remedy: str = ""


def ok(subject: str, message: str) -> DoctorFinding:
    """All is well."""
    return DoctorFinding(FindingLevel.OK, subject, message)


def warning(subject: str, message: str, remedy: str) -> DoctorFinding:
    """Works, but somebody should know."""
    return DoctorFinding(FindingLevel.WARNING, subject, message, remedy)


def problem(subject: str, message: str, remedy: str) -> DoctorFinding:
    """Does not work."""
    return DoctorFinding(FindingLevel.PROBLEM, subject, message, remedy)


def check_keys(folder: Path, now: float, *, needed: bool) -> Iterator[DoctorFinding]:
    """Look at the keys in ``folder``; that there are none is a problem only when ``needed``."""
    if not folder.exists():
        if needed:
            yield problem("keys", f"there are none in {folder}", "get some: `scenario keys bundle`")
        return
    try:
        if folder.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            yield warning("keys", f"others can look into {folder}", f"chmod 700 {folder}")
        if is_authority(folder):
            for issued in load_register(folder).issued:
                yield from _issued_findings(issued, now)
        else:
            holder = find_credentials(Role.OPERATOR, folder)
            yield _expiry_finding(holder.name, holder.role, holder.expires_at, now)
    except (KeysUnusable, OSError) as error:
        yield problem("keys", str(error), "see `scenario keys --help`")


def _issued_findings(issued: IssuedKey, now: float) -> Iterator[DoctorFinding]:
    if issued.revoked_at is None:
        yield _expiry_finding(issued.name, issued.role, issued.expires_at, now)


def _expiry_finding(name: str, role: Role, expires_at: float, now: float) -> DoctorFinding:
    day = f"{datetime.fromtimestamp(expires_at, UTC):%Y-%m-%d}"
    if now >= expires_at:
        return problem("keys", f'"{name}" has expired on {day}', _RENEWAL.format(role=role))
    if now > expires_at - _EXPIRES_SOON:
        return warning("keys", f'"{name}" expires on {day}', _RENEWAL.format(role=role))
    return ok("keys", f'"{name}", good until {day}')


def check_ledger(paths: StatePaths, now: float) -> Iterator[DoctorFinding]:
    """Check the file, the references in it, its own rules, and that ``now`` is not in its past."""
    if not paths.ledger.exists():
        yield ok("ledger", "none yet: the first daemon makes it")
        return
    try:
        found = check_integrity(paths.ledger)
    except DaemonError as error:
        yield problem("ledger", str(error), _BACKUP)
        return
    yield _ledger_finding(found)
    if found.version == SCHEMA_VERSION and not found.damage:
        yield from _content_findings(found, now)


def _ledger_finding(found: LedgerIntegrity) -> DoctorFinding:
    if found.version > SCHEMA_VERSION:
        return problem(
            "ledger",
            f"has schema {found.version}, this version knows {SCHEMA_VERSION}",
            "use the version that made it, or another state directory",
        )
    if found.damage:
        return problem("ledger", f"is damaged: {'; '.join(found.damage)}", _BACKUP)
    if found.version < SCHEMA_VERSION:
        return warning(
            "ledger",
            f"whole, schema {found.version} of an earlier version",
            "the next daemon brings it up to date; copy it if you may go back",
        )
    if found.violations:
        words = "; ".join(found.violations)
        return problem("ledger", words, "please report it, with a copy of the ledger")
    numbers = f"{found.runs} runs, {found.results} results"
    return ok("ledger", f"whole, schema {SCHEMA_VERSION}, {numbers}")


def _content_findings(found: LedgerIntegrity, now: float) -> Iterator[DoctorFinding]:
    if found.alarms:
        yield warning(
            "determinism",
            f"{found.alarms} times another execution of a run came out differently",
            "see `scenario results --runs --filter nondeterministic`",
        )
    if found.newest_event > now + _LEDGER_SKEW:
        yield problem(
            "clock",
            f"it is {found.newest_event - now:.0f} s before the ledger's newest event",
            "set the clock (timedatectl); leases end late until it has caught up",
        )
    else:
        yield ok("clock", "not before the ledger's newest event")


def check_leftovers(paths: StatePaths, here: Path) -> Iterator[DoctorFinding]:
    """Look for partial traces, orphan spools, unknown traces, and workshops at and below ``here``.

    Locks are tried for a moment, shared; nothing is changed.
    """
    found = [
        *_leftover_findings(
            "partial traces", _partial_traces(paths), "remove them while no worker runs: {remove}"
        ),
        *_leftover_findings(
            "spools of dead workers",
            _orphan_spools(paths),
            "the next worker to start delivers what is finished and removes them",
        ),
        *_leftover_findings(
            "traces unknown to the ledger", _unknown_traces(paths), "if unwanted: {remove}"
        ),
        *_leftover_findings(
            "workshops of interrupted runs",
            _temporary_folders(here),
            "if no `scenario run` uses them: {remove}",
        ),
    ]
    yield from found or [ok("leftovers", "none")]


def _leftover_findings(what: str, paths: Iterable[Path], remedy: str) -> Iterator[DoctorFinding]:
    found = sorted(paths)
    if not found:
        return
    names = " ".join(shlex.quote(str(path)) for path in found[:_SHOWN])
    more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    message = f"{what}: {', '.join(str(path) for path in found[:_SHOWN])}{more}"
    yield warning("leftovers", message, remedy.format(remove=f"rm -r {names}"))


def _partial_traces(paths: StatePaths) -> Iterator[Path]:
    # Of grammars.text.files.replacing, and of a trace that is being written.
    for pattern in ("*/.*.tmp", "*/*.partial"):
        yield from paths.traces.glob(pattern)


def _orphan_spools(paths: StatePaths) -> Iterator[Path]:
    for folder in paths.spool.glob("*"):
        if is_id(folder.name) and (folder / "lock").exists() and not is_locked(folder / "lock"):
            yield folder


def _unknown_traces(paths: StatePaths) -> Iterator[Path]:
    known: frozenset[str] = frozenset()
    if paths.ledger.exists():
        try:
            with LedgerReader.open(paths) as ledger:
                known = ledger.campaign_ids()
        except DaemonError:
            return  # the ledger's own finding says so
    yield from (folder for folder in paths.traces.glob("*") if folder.name not in known)


def _temporary_folders(here: Path) -> Iterator[Path]:
    for pattern in (".scenario-*", "*/.scenario-*", "scenario-results/*/.scenario-*"):
        for folder in here.glob(pattern):
            if folder.is_dir() and not is_locked(folder / "daemon.lock"):
                yield folder


def is_locked(path: Path) -> bool:
    """Whether somebody holds the lock that ``path`` is."""
    with suppress(FileNotFoundError), path.open("rb") as lock:
        try:
            # Shared, so that two doctors do not take each other for its holder, and given back at
            # once: a daemon that starts meanwhile would be told that there is one already.
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
