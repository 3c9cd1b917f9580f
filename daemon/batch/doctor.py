"""The examination of the configuration, the state and the daemon; it changes nothing."""

from __future__ import annotations

import math
import os
import platform
import stat
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Final

from daemon.batch.amounts import size_text
from daemon.batch.client import Client
from daemon.batch.errors import DaemonError, KeysUnusable, Unavailable
from daemon.batch.ledger import (
    SCHEMA_REMEDY,
    SCHEMA_VERSION,
    ContentReport,
    LedgerIntegrity,
    VerificationProgress,
    check_integrity,
    find_strays,
    schema_problem,
    verify_contents,
)
from daemon.batch.paths import (
    Endpoint,
    StatePaths,
    endpoint_text,
    is_encrypted,
    is_endpoint,
    is_local,
    is_locked,
    is_same_folder,
)
from daemon.batch.permissions import Exposure, find_exposure, find_key_exposure
from daemon.batch.security import find_credentials, is_authority, keys_folder, load_register
from daemon.model.execution import available_cores, core_quota
from daemon.model.ids import is_id
from daemon.model.spec import ENGINE_VERSION
from daemon.model.status import (
    NONDETERMINISTIC,
    DaemonOverview,
    DiskUsage,
    TroubleCause,
    WorkerRow,
)
from daemon.model.verbs import Role
from grammars.text.words import first_words

_PACKAGES: Final = ("eclipse-zenoh", "numpy", "numba", "pymunk", "pydantic", "mcap", "textual")
# Seconds. Leases use the daemon's clock alone; this is for times that people compare.
_SKEW: Final = 2.0
_ROOMY: Final = 2 * 2**30
_FREE_SOME: Final = "free some: `scenario gc --max-size 10GiB --dry-run`"
_EXPIRES_SOON: Final = 30 * 86_400.0
_RENEWAL: Final = "`scenario keys issue {role} NAME` makes another, `scenario keys bundle` packs it"
_STRAYS_GO: Final = "`scenario gc` removes them, as a daemon does hourly"
_OLDEST_NOW: Final = 1_735_689_600.0
"""2025-01-01: an earlier clock was never set."""
_LEDGER_SKEW: Final = 5.0
"""A clock under correction may be a little behind its earlier time [s]."""
_BACKUP: Final = (
    "stop the daemon, keep a copy of the directory, restore the ledger from a backup "
    "or save the readable part with `sqlite3 ledger.db .recover`"
)
_WRONG: Final = (
    "recorded data was changed: restore a backup, "
    "or `scenario retry CAMPAIGN --only all` runs it again and compares"
)
_LONGEST: Final = 400
"""Longest text of an unexpected exception [characters]."""


class FindingLevel(StrEnum):
    """Severity of a finding; a problem prevents runs or endangers their results."""

    OK = "ok"
    WARNING = "warning"
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class DoctorFinding:
    """Finding of a check of ``subject``; ``remedy`` is empty if all is well."""

    level: FindingLevel
    subject: str
    message: str
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class Examination:
    """Findings about the installation whose state directory is ``state``."""

    state: Path
    endpoint: Endpoint
    findings: tuple[DoctorFinding, ...]


ok = partial(DoctorFinding, FindingLevel.OK)
warning = partial(DoctorFinding, FindingLevel.WARNING)
problem = partial(DoctorFinding, FindingLevel.PROBLEM)
"""Makers of findings from subject, message and, unless all is well, the remedy."""


def guarded(subject: str, check: Callable[[], Iterable[DoctorFinding]]) -> Iterator[DoctorFinding]:
    """Yield the findings of a check; its failure is a finding too, and never stops the others."""
    try:
        yield from check()
    except Exception as error:
        words = f"cannot be examined: {type(error).__name__}: {error}"[:_LONGEST]
        yield problem(subject, words, "it is damaged or in use in an unexpected way: report it")


def examine(
    paths: StatePaths,
    endpoint: Endpoint,
    *,
    quick: bool = False,
    traces: bool = False,
    progress: VerificationProgress = lambda *_: None,
) -> tuple[DoctorFinding, ...]:
    """Return all findings about the state directory and the endpoint.

    ``quick`` covers only the newest results; ``traces`` reads all traces. Never fails: a failing
    check is a finding.
    """
    now = time.time()
    checks: dict[str, Callable[[], Iterable[DoctorFinding]]] = {
        "versions": _versions,
        "slots": _slots,
        "kernels": _kernels,
        "state": lambda: _state(paths),
        "ledger": lambda: _ledger(paths, now, progress, quick=quick, traces=traces),
        "clock": lambda: _clock(now),
        "endpoint": lambda: _endpoint(endpoint),
        "keys": lambda: check_keys(keys_folder(), now, needed=is_encrypted(endpoint.address)),
        "daemon": lambda: _daemon(paths, endpoint) if is_endpoint(endpoint.address) else (),
        "leftovers": lambda: check_leftovers(paths, now),
    }
    return tuple(one for subject, check in checks.items() for one in guarded(subject, check))


def _slots() -> Iterator[DoctorFinding]:
    quota = f" (the container's quota is {core_quota():.3g})" if core_quota() < math.inf else ""
    words = f"{available_cores()} cores may be used{quota}, one run each by default: "
    words += "--slots changes it"
    yield ok("slots", words)


def _versions() -> Iterator[DoctorFinding]:
    packages = ", ".join(f"{name} {version(name)}" for name in _PACKAGES)
    own = f"scenario-tui {version('scenario-tui')}, engine {ENGINE_VERSION}"
    yield ok("versions", f"{own}, python {platform.python_version()}, {packages}")


def _kernels() -> Iterator[DoctorFinding]:
    from daemon.model.kernels import cache_folder, count_kernels

    if count := count_kernels():
        yield ok("kernels", f"{count} compiled kernels in {cache_folder()}")
    else:
        yield warning("kernels", "not compiled yet", "the first runs take longer, once")


def _state(paths: StatePaths) -> Iterator[DoctorFinding]:
    state = paths.state
    if not state.exists():
        yield ok("state", f"{state} does not exist yet: the first daemon creates it")
        return
    if not state.is_dir() or not os.access(state, os.R_OK | os.W_OK | os.X_OK):
        yield problem(
            "state",
            f"{state} is not a writable directory",
            "choose another with --state, or change its owner",
        )
        return
    yield from _permissions(paths)
    disk = paths.disk()
    sizes = f"{disk.free / 2**30:.1f} of {disk.total / 2**30:.1f} GiB free, "
    sizes += f"ledger {disk.ledger / 2**20:.1f} MiB"
    if shortage := paths.disk_shortage():
        yield problem("disk", shortage, _FREE_SOME)
    elif disk.free < _ROOMY:
        yield warning("disk", sizes, _FREE_SOME)
    else:
        yield ok("disk", sizes)


def _permissions(paths: StatePaths) -> Iterator[DoctorFinding]:
    exposure, remedy = find_exposure(paths.folders), f"chmod -R go-rwx {paths.state}"
    owner = "run the daemon as their owner, or choose another directory with --state"
    # Only a warning for readable ones: the daemon corrects this when it starts.
    findings = list(_exposed("state", exposure, owner, remedy, readable=FindingLevel.WARNING))
    yield from findings or [ok("state", f"{paths.state}, yours alone")]


def _exposed(
    subject: str, exposure: Exposure, owner: str, remedy: str, *, readable: FindingLevel
) -> Iterator[DoctorFinding]:
    if exposure.foreign:
        yield problem(subject, f"{first_words(exposure.foreign)} belong to somebody else", owner)
    if exposure.writable:
        yield problem(subject, f"others can write {first_words(exposure.writable)}", remedy)
    if exposure.readable:
        message = f"others can read {first_words(exposure.readable)}"
        yield DoctorFinding(readable, subject, message, remedy)


def _ledger(
    paths: StatePaths, now: float, progress: VerificationProgress, *, quick: bool, traces: bool
) -> Iterator[DoctorFinding]:
    """Check the ledger's file and contents, and that ``now`` is not before its newest event.

    ``quick`` skips most of the contents; ``traces`` reads all traces.
    """
    if not paths.ledger.exists():
        yield ok("ledger", "none yet: the first daemon creates it")
        return
    try:
        integrity = check_integrity(paths.ledger, quick=quick)
    except Unavailable as error:
        yield problem("ledger", str(error), "end its user: `fuser -v ledger.db` names it")
        return
    except DaemonError as error:
        yield problem("ledger", str(error), _BACKUP)
        return
    if not integrity.version:
        yield _empty_finding(paths)
        return
    yield _ledger_finding(integrity)
    if integrity.version == SCHEMA_VERSION and not integrity.damage:
        yield from _history_findings(integrity, now)
        try:
            report = verify_contents(paths, quick=quick, traces=traces, progress=progress)
        except DaemonError as error:
            yield problem("contents", str(error), _BACKUP)
        else:
            yield from _content_findings(report, quick=quick)


def _empty_finding(paths: StatePaths) -> DoctorFinding:
    if any(any(folder.glob("*")) for folder in (paths.scenes, paths.traces)):
        words = "is empty, although there are scenes or traces: the recorded data is lost"
        return problem("ledger", words, "restore a backup before a daemon starts here")
    return ok("ledger", "empty: the next daemon creates its tables")


def _ledger_finding(integrity: LedgerIntegrity) -> DoctorFinding:
    if integrity.version != SCHEMA_VERSION:
        return problem("ledger", schema_problem(integrity.version), SCHEMA_REMEDY)
    if integrity.damage:
        return problem("ledger", f"is damaged: {'; '.join(integrity.damage)}", _BACKUP)
    numbers = f"{integrity.runs} runs, {integrity.results} results"
    return ok("ledger", f"whole, schema {SCHEMA_VERSION}, {numbers}")


def _history_findings(integrity: LedgerIntegrity, now: float) -> Iterator[DoctorFinding]:
    if integrity.alarms:
        yield warning(
            "determinism",
            f"{integrity.alarms} times another execution of a run had another result",
            f"see `scenario results --runs --filter {NONDETERMINISTIC}`",
        )
    if integrity.newest_event > now + _LEDGER_SKEW:
        yield problem(
            "clock",
            f"it is {integrity.newest_event - now:.0f} s before the ledger's newest event",
            "set the clock (timedatectl); times in lists are wrong until it has caught up",
        )
    else:
        yield ok("clock", "not before the ledger's newest event")


def _content_findings(report: ContentReport, *, quick: bool) -> Iterator[DoctorFinding]:
    for words, places in report.problems.items():
        yield problem("contents", f"{words}: {first_words(places)}", _WRONG)
    if report.missing:
        first = ", ".join(name[:12] for name in report.missing[:3])
        yield problem(
            "contents",
            f"{len(report.missing)} scenes or files of waiting runs are missing: {first}",
            "submit their campaigns again, which sends the missing ones",
        )
    for words in report.foreign:
        yield warning("contents", words.partition(": ")[0], words.partition(": ")[2])
    if not report.problems and not report.missing:
        number = report.counts
        counts = f"{number['results']} results, {number['specifications']} specifications"
        if quick:
            words = f"the newest {counts} agree with their digests"
        else:
            words = f"{counts}, {number['scenes']} scenes and {number['files']} files agree with "
            words += f"their digests, {number['traces']} traces with their records"
        yield ok("contents", words)


def _clock(now: float) -> Iterator[DoctorFinding]:
    if now < _OLDEST_NOW:
        yield problem("clock", f"it says {time.ctime(now)}", "set the clock (timedatectl)")


def _endpoint(endpoint: Endpoint) -> Iterator[DoctorFinding]:
    is_valid = is_endpoint(endpoint.address)
    where = endpoint_text(endpoint.address) if is_valid else endpoint.address
    words = f"{where}, from {endpoint.origin}"
    if not is_valid:
        remedy = "write tcp/<host>:<port> or tls/<host>:<port>"
        yield problem("endpoint", f"{words}: not a valid endpoint", remedy)
    elif not (is_encrypted(endpoint.address) or is_local(endpoint.address)):
        yield warning(
            "endpoint",
            f"{words}: plain TCP to another machine",
            "anybody in the network may read, submit and cancel: use tls/ (`scenario keys`)",
        )
    else:
        yield ok("endpoint", words)


def _daemon(paths: StatePaths, endpoint: Endpoint) -> Iterator[DoctorFinding]:
    try:
        with Client.open(endpoint.address) as client:
            before = time.time()
            overview, after = client.overview(), time.time()
            workers, disk = client.workers(), client.disk()
    except DaemonError as error:
        yield _silence(paths, endpoint, error)
        return
    yield from _answering(overview, paths, endpoint)
    skew = overview.now - (before + after) / 2
    if abs(skew) > _SKEW:
        yield warning(
            "clock",
            f"the daemon's differs by {skew:+.1f} s from this machine's",
            "synchronise both (timedatectl set-ntp true)",
        )
    yield _traces(disk)
    yield from _workers(workers, overview)


def _traces(disk: DiskUsage) -> DoctorFinding:
    words = f"{size_text(disk.traces)} in the state directory"
    if not disk.quota:
        return ok("traces", f"{words}, no quota: `scenario daemon --quota 20GiB` sets one")
    words += f", the quota is {size_text(disk.quota)}"
    if disk.traces <= disk.quota:
        return ok("traces", words)
    return problem("traces", words, "start the daemon with a larger --quota, or cancel a campaign")


def _silence(paths: StatePaths, endpoint: Endpoint, error: DaemonError) -> DoctorFinding:
    if endpoint.origin in ("--connect", "SCENARIO_CONNECT"):
        return problem("daemon", str(error), f"start it there, or correct {endpoint.origin}")
    contact = paths.read_contact()
    if contact is None:
        return ok("daemon", "not running: `scenario submit` or `scenario daemon` starts one")
    if is_locked(paths.lock):
        return problem(
            "daemon",
            f"process {contact.pid} keeps the directory and does not answer",
            f"see {paths.log}; end it with kill, else kill -9 (recorded results stay)",
        )
    return warning(
        "daemon",
        f"process {contact.pid} was killed and left daemon.json behind",
        "the next daemon replaces it and goes on with the queued runs",
    )


def _answering(
    overview: DaemonOverview, paths: StatePaths, endpoint: Endpoint
) -> Iterator[DoctorFinding]:
    own = version("scenario-tui")
    own_daemon = is_same_folder(Path(overview.state), paths.state)
    if not own_daemon and endpoint.origin in ("daemon.json", "default"):
        yield problem(
            "daemon",
            f"the one at {endpoint_text(endpoint.address)} uses {overview.state}",
            f"name it with --state, or start one for {paths.state}",
        )
        return
    if overview.version != own:
        yield warning(
            "daemon",
            f"it is version {overview.version}, this is {own}",
            "`scenario daemon --stop` and start it again",
        )
    else:
        waiting = f"{overview.queued} runs queued, {overview.running} running"
        yield ok("daemon", f"answers at {endpoint_text(endpoint.address)}, {waiting}")
    for number, trouble in enumerate(overview.troubles):
        last = trouble.words.strip().splitlines()[-1]
        remedy = _remedy(trouble.cause, paths)
        if number == 0 and overview.halted:
            yield problem("daemon", f"no run can start: {last}", remedy)
        else:
            yield warning("trouble", last, remedy)


def _remedy(cause: TroubleCause, paths: StatePaths) -> str:
    """Return the remedy for a trouble by its cause."""
    match cause:
        case TroubleCause.SPACE:
            return _FREE_SOME
        case TroubleCause.WORKER:
            return "check its machine; the worker retries by itself, at least once a minute"
        case TroubleCause.INPUT:
            return f"`scenario submit` the same campaign; {paths.aside} keeps the damaged one"
        case TroubleCause.OTHER:
            return f"see {paths.worker_log} and {paths.log}"


def _workers(workers: tuple[WorkerRow, ...], overview: DaemonOverview) -> Iterator[DoctorFinding]:
    if not workers and overview.preparing:
        yield ok("workers", overview.preparing)
    elif not workers:
        yield warning(
            "workers",
            "none is connected: no run will be executed",
            "start one with `scenario worker`",
        )
    for worker in workers:
        words = f"{worker.id} on {worker.host}, {worker.busy} of {worker.slots} slots busy"
        if worker.version != overview.version:
            yield warning(
                "workers", f"{words}, version {worker.version}", f"install {overview.version} there"
            )
        elif worker.away:
            silent = overview.now - worker.last_seen_at
            yield warning(
                "workers",
                f"{words}, away, silent for {silent:.0f} s",
                "check its machine",
            )
        else:
            yield ok("workers", f"{words}, {worker.preparing}" if worker.preparing else words)


def check_keys(folder: Path, now: float, *, needed: bool) -> Iterator[DoctorFinding]:
    """Check the keys in ``folder``; missing keys are a problem only if ``needed``."""
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
    """Check the access of others to keys: anybody who can add one decides who is admitted."""
    exposure, remedy = find_key_exposure(folder), f"chmod -R go-rwx {folder}, have new keys made"
    owner = "have keys of your own made: `scenario keys --help`"
    yield from _exposed("keys", exposure, owner, remedy, readable=FindingLevel.PROBLEM)
    is_open = folder.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    if is_open and not (exposure.readable or exposure.writable):
        yield warning("keys", f"others can look into {folder}", f"chmod 700 {folder}")


def _expiry_finding(name: str, role: Role, expires_at: float, now: float) -> DoctorFinding:
    day = f"{datetime.fromtimestamp(expires_at, UTC):%Y-%m-%d}"
    if now >= expires_at:
        return problem("keys", f'"{name}" expired on {day}', _RENEWAL.format(role=role))
    if now > expires_at - _EXPIRES_SOON:
        return warning("keys", f'"{name}" expires on {day}', _RENEWAL.format(role=role))
    return ok("keys", f'"{name}", good until {day}')


def check_leftovers(paths: StatePaths, now: float) -> Iterator[DoctorFinding]:
    """Check for strays, files set aside and undelivered results, without changes."""
    leftovers: defaultdict[tuple[str, str], list[Path]] = defaultdict(list)
    if paths.ledger.exists():
        with suppress(DaemonError):  # the check of the ledger reports it
            for stray in find_strays(paths, now):
                leftovers[stray.what, _STRAYS_GO].append(stray.path)
    strays = {path for places in leftovers.values() for path in places}
    dead = "spools of dead workers", "the next worker takes them over"
    why = f"see {paths.log} and {paths.worker_log} for the reason; you may remove them"
    for place in (paths, *paths.caches):
        for spool in place.spool.glob("*/lock"):
            if is_id(spool.parent.name) and spool.parent not in strays and not is_locked(spool):
                leftovers[dead].append(spool.parent)
        for path in place.aside.glob("*"):
            leftovers["moved aside, damaged or not removable", why].append(path)
    for (kind, remedy), places in leftovers.items():
        yield warning("leftovers", f"{kind}, {len(places)}: {first_words(places)}", remedy)
    if not leftovers:
        yield ok("leftovers", "none")
