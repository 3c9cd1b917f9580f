"""The doctor's checks of keys, and of what killed processes left behind."""

from __future__ import annotations

import stat
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from daemon.batch.errors import DaemonError, KeysUnusable
from daemon.batch.ledger import find_strays
from daemon.batch.locks import is_locked
from daemon.batch.operation._findings import DoctorFinding, names, ok, problem, warning
from daemon.batch.paths import StatePaths
from daemon.batch.permissions import find_key_exposure
from daemon.batch.security import find_credentials, is_authority, load_register
from daemon.model.ids import is_id
from daemon.model.verbs import Role

_EXPIRES_SOON: Final = 30 * 86_400.0
_RENEWAL: Final = "`scenario keys issue {role} NAME` makes another, `scenario keys bundle` packs it"


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
                if issued.revoked_at is None:
                    yield _expiry_finding(issued.name, issued.role, issued.expires_at, now)
        else:
            holder = find_credentials(Role.OPERATOR, folder)
            yield _expiry_finding(holder.name, holder.role, holder.expires_at, now)
    except (KeysUnusable, OSError) as error:
        yield problem("keys", str(error), "see `scenario keys --help`")


def _exposed_keys(folder: Path) -> Iterator[DoctorFinding]:
    """Look who else may write or read keys: whoever can put one there decides who is admitted."""
    found, remedy = find_key_exposure(folder), f"chmod -R go-rwx {folder}, have new keys made"
    if found.foreign:
        words = f"{names(found.foreign)} belong to somebody else"
        yield problem("keys", words, "have keys of your own made: `scenario keys --help`")
    if found.writable:
        yield problem("keys", f"others can write {names(found.writable)}", remedy)
    if found.readable:
        yield problem("keys", f"others can read {names(found.readable)}", remedy)
    elif not found.writable and folder.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        yield warning("keys", f"others can look into {folder}", f"chmod 700 {folder}")


def _expiry_finding(name: str, role: Role, expires_at: float, now: float) -> DoctorFinding:
    day = f"{datetime.fromtimestamp(expires_at, UTC):%Y-%m-%d}"
    if now >= expires_at:
        return problem("keys", f'"{name}" has expired on {day}', _RENEWAL.format(role=role))
    if now > expires_at - _EXPIRES_SOON:
        return warning("keys", f'"{name}" expires on {day}', _RENEWAL.format(role=role))
    return ok("keys", f'"{name}", good until {day}')


def check_leftovers(paths: StatePaths, now: float) -> Iterator[DoctorFinding]:
    """Look for strays, things moved aside and results that nobody delivers; changes nothing."""
    remedies: dict[str, str] = {}
    found: defaultdict[str, list[Path]] = defaultdict(list)

    def add(what: str, path: Path, remedy: str) -> None:
        remedies[what] = remedy
        found[what].append(path)

    if paths.ledger.exists():
        with suppress(DaemonError):  # the ledger's own finding says so
            for stray in find_strays(paths, now):
                add(stray.what, stray.path, "`scenario gc` removes them, as a daemon does hourly")
    known = {path for paths in found.values() for path in paths}
    for place in (paths, *paths.caches):
        for spool in place.spool.glob("*/lock"):
            if is_id(spool.parent.name) and spool.parent not in known and not is_locked(spool):
                add("spools of dead workers", spool.parent, "the next worker takes them over")
        for path in place.aside.glob("*"):
            why = f"{paths.log} and {paths.worker_log} say why; remove them when you like"
            add("moved aside, damaged or not removable", path, why)
    for what, places in found.items():
        words = f"{what}, {len(places)}: {names(places)}"
        yield warning("leftovers", words, remedies[what])
    if not found:
        yield ok("leftovers", "none")
