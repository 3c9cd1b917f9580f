"""The doctor's checks of keys, and of what something killed left behind."""

from __future__ import annotations

import shlex
import stat
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError, KeysUnusable
from daemon.batch.ledger import LedgerReader, StrayFile, find_strays
from daemon.batch.locks import is_locked
from daemon.batch.operation._findings import DoctorFinding, ok, problem, warning
from daemon.batch.paths import StatePaths
from daemon.batch.permissions import find_key_exposure
from daemon.batch.security import IssuedKey, find_credentials, is_authority, load_register
from daemon.model.ids import is_id
from daemon.model.verbs import Role

_EXPIRES_SOON: Final = 30 * 86_400.0
_RENEWAL: Final = "`scenario keys issue {role} NAME` makes another, `scenario keys bundle` packs it"
_SHOWN: Final = 3


def check_keys(folder: Path, now: float, *, needed: bool) -> Iterator[DoctorFinding]:
    """Look at the keys in ``folder``; that there are none is a problem only when ``needed``."""
    if not folder.exists():
        if needed:
            yield problem("keys", f"there are none in {folder}", "get some: `scenario keys bundle`")
        return
    try:
        yield from _exposed_keys(folder)
        if is_authority(folder):
            for issued in load_register(folder).issued:
                yield from _issued_findings(issued, now)
        else:
            holder = find_credentials(Role.OPERATOR, folder)
            yield _expiry_finding(holder.name, holder.role, holder.expires_at, now)
    except (KeysUnusable, OSError) as error:
        yield problem("keys", str(error), "see `scenario keys --help`")


def _exposed_keys(folder: Path) -> Iterator[DoctorFinding]:
    """Look who else may write or read keys: whoever can put one there decides who is admitted."""
    found, remedy = find_key_exposure(folder), f"chmod -R go-rwx {folder}, have new keys made"
    if found.foreign:
        words = f"{found.foreign[0]} belongs to somebody else"
        yield problem("keys", words, "have keys of your own made: `scenario keys --help`")
    if found.writable:
        words = f"others can write {', '.join(map(str, found.writable[:_SHOWN]))}"
        yield problem("keys", words, remedy)
    if found.readable:
        words = f"others can read {', '.join(map(str, found.readable[:_SHOWN]))}"
        yield problem("keys", words, remedy)
    elif not found.writable and folder.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        yield warning("keys", f"others can look into {folder}", f"chmod 700 {folder}")


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


def check_leftovers(paths: StatePaths, here: Path, now: float) -> Iterator[DoctorFinding]:
    """Look for what nobody needs, partial traces, orphan spools, unknown traces, workshops.

    The last are looked for at and below ``here``. Locks are tried for a moment, shared; nothing
    is changed.
    """
    readable = paths.ledger.exists()
    strays = _strays(paths, now) if readable else ()
    named = {stray.path for stray in strays}
    found = [
        *_stray_findings(strays),
        *_leftover_findings(
            "partial traces",
            (path for path in _partial_traces(paths) if path not in named),
            "remove them while no worker runs: {remove}",
        ),
        *_leftover_findings(
            "spools of dead workers",
            (folder for folder in _orphan_spools(paths) if folder not in named),
            "the next worker to start delivers what is finished and removes them",
        ),
        *_leftover_findings(
            "traces unknown to the ledger",
            (folder for folder in _unknown_traces(paths, readable) if folder not in named),
            "if unwanted: {remove}",
        ),
        *_leftover_findings(
            "workshops of interrupted runs",
            _temporary_folders(here),
            "if no `scenario run` uses them: {remove}",
        ),
    ]
    yield from found or [ok("leftovers", "none")]


def _strays(paths: StatePaths, now: float) -> tuple[StrayFile, ...]:
    try:
        return find_strays(paths, now)
    except DaemonError:
        return ()  # the ledger's own finding says so


def _stray_findings(strays: tuple[StrayFile, ...]) -> Iterator[DoctorFinding]:
    for kind in dict.fromkeys(stray.what for stray in strays):
        yield from _leftover_findings(
            f"of use to nobody, {kind}",
            (stray.path for stray in strays if stray.what == kind),
            "`scenario gc` removes them, as a daemon does every hour",
        )


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


def _unknown_traces(paths: StatePaths, readable: bool) -> Iterator[Path]:
    known: frozenset[str] = frozenset()
    if readable:
        try:
            with LedgerReader.open(paths) as ledger:
                known = ledger.campaign_ids()
        except DaemonError:
            return  # the ledger's own finding says so
    elif paths.ledger.exists():
        return
    yield from (folder for folder in paths.traces.glob("*") if folder.name not in known)


def _temporary_folders(here: Path) -> Iterator[Path]:
    for pattern in (".scenario-*", "*/.scenario-*", "scenario-results/*/.scenario-*"):
        for folder in here.glob(pattern):
            if folder.is_dir() and not is_locked(folder / "daemon.lock"):
                yield folder
