"""Keys: whether they can be used, and how long they still are good for."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from daemon.errors import KeysUnusable
from daemon.operation._findings import Finding, ok, problem, warning
from daemon.security import Issued, Role, find_holder, is_authority, registered

_SOON: Final = 30 * 86_400.0
_AGAIN: Final = "`scenario keys issue {role} NAME` makes another, `scenario keys bundle` packs it"


def check_keys(folder: Path, now: float, *, needed: bool) -> Iterator[Finding]:
    """Look at the keys in ``folder``; that there are none is a problem only when ``needed``."""
    if not folder.exists():
        if needed:
            yield problem("keys", f"there are none in {folder}", "get some: `scenario keys bundle`")
        return
    try:
        if folder.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            yield warning("keys", f"others can look into {folder}", f"chmod 700 {folder}")
        if is_authority(folder):
            for issued in registered(folder).issued:
                yield from _issued(issued, now)
        else:
            holder = find_holder(Role.OPERATOR, folder)
            yield _until(holder.name, holder.role, holder.expires_at, now)
    except (KeysUnusable, OSError) as error:
        yield problem("keys", str(error), "see `scenario keys --help`")


def _issued(issued: Issued, now: float) -> Iterator[Finding]:
    if issued.revoked_at is None:
        yield _until(issued.name, issued.role, issued.expires_at, now)


def _until(name: str, role: Role, expires_at: float, now: float) -> Finding:
    day = f"{datetime.fromtimestamp(expires_at, UTC):%Y-%m-%d}"
    if now >= expires_at:
        return problem("keys", f'"{name}" has expired on {day}', _AGAIN.format(role=role))
    if now > expires_at - _SOON:
        return warning("keys", f'"{name}" expires on {day}', _AGAIN.format(role=role))
    return ok("keys", f'"{name}", good until {day}')
