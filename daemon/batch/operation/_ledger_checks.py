"""The doctor's checks of the ledger: its WAL, its file, its rules, and what it says of results."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from daemon.batch.amounts import size_text
from daemon.batch.errors import DaemonError, Unavailable
from daemon.batch.ledger import (
    SCHEMA_VERSION,
    ContentReport,
    LedgerIntegrity,
    VerificationProgress,
    WalState,
    check_integrity,
    damaged_copies,
    read_wal,
    verify_contents,
)
from daemon.batch.operation._findings import DoctorFinding, ok, problem, warning
from daemon.batch.paths import StatePaths

# Seconds: a clock that is being disciplined may be a little behind what it said before.
_LEDGER_SKEW: Final = 5.0
_BACKUP: Final = (
    "stop the daemon, keep a copy of the directory, restore the ledger from a backup "
    "or save what is readable with `sqlite3 ledger.db .recover`"
)
_WRONG: Final = (
    "somebody or something changed what was recorded: restore a backup, "
    "or `scenario retry CAMPAIGN --only all` runs it again and compares"
)


def check_ledger(
    paths: StatePaths,
    now: float,
    *,
    quick: bool = False,
    traces: bool = False,
    progress: VerificationProgress = lambda *_: None,
) -> Iterator[DoctorFinding]:
    """Check the WAL, the file, the ledger's rules, its contents, and that ``now`` is not before.

    A ``quick`` look leaves most of the contents out; with ``traces`` all of them are read.
    """
    damaged = list(_wal_findings(paths))
    yield from damaged
    if not paths.ledger.exists():
        if not damaged:
            yield ok("ledger", "none yet: the first daemon makes it")
        return
    if any(finding.subject == "wal" and finding.remedy for finding in damaged):
        # To open it now would make SQLite drop what stands behind the damage.
        return
    try:
        found = check_integrity(paths.ledger, quick=quick)
    except Unavailable as error:
        yield problem("ledger", str(error), "end what holds it: `fuser -v ledger.db` names it")
        return
    except DaemonError as error:
        yield problem("ledger", str(error), _BACKUP)
        return
    if not found.version and _holds_work(paths):
        words = "is empty, though scenes or traces lie beside it: what was recorded is gone"
        yield problem("ledger", words, "restore a backup before a daemon starts here")
        return
    yield _ledger_finding(found)
    if found.version == SCHEMA_VERSION and not found.damage:
        yield from _history_findings(found, now)
        try:
            report = verify_contents(paths, quick=quick, traces=traces, progress=progress)
        except DaemonError as error:
            yield problem("contents", str(error), _BACKUP)
        else:
            yield from _content_findings(report, quick=quick)


def _holds_work(paths: StatePaths) -> bool:
    return any(any(folder.glob("*")) for folder in (paths.scenes, paths.traces))


def _wal_findings(paths: StatePaths) -> Iterator[DoctorFinding]:
    copies = damaged_copies(paths.ledger)
    if copies:
        yield problem(
            "ledger",
            f"its WAL was damaged, acknowledged changes were lost: see {copies[-1]}",
            "see which campaigns are missing or not finished, submit them again, remove the file",
        )
    try:
        wal = read_wal(paths.ledger)
    except OSError as error:
        yield problem("wal", f"the ledger's WAL cannot be read: {error}", "see who owns it")
        return
    if wal.damaged:
        yield problem("wal", _damage_words(wal), _damage_remedy(wal))
    elif wal.size:
        waiting = wal.committed - wal.checkpointed
        words = f"sound, {size_text(wal.size)}, {waiting} pages of it not in the ledger yet"
        yield ok("wal", words)
    elif paths.ledger.exists():
        yield ok("wal", "empty: everything is in the ledger")


def _damage_words(wal: WalState) -> str:
    where = f"the ledger's WAL ({size_text(wal.size)}) is damaged behind page {wal.sound} of "
    where += f"{wal.committed}"
    if not wal.lost:
        return f"{where}; everything in it is in the ledger as well"
    return f"{where}: about {wal.lost} acknowledged changes are lost"


def _damage_remedy(wal: WalState) -> str:
    if not wal.lost:
        return "start the daemon: it puts the WAL aside and goes on with the ledger"
    return (
        "keep a copy of the directory before anything opens the ledger; the daemon, when it "
        "starts, puts the WAL aside and goes on with what is sound"
    )


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


def _history_findings(found: LedgerIntegrity, now: float) -> Iterator[DoctorFinding]:
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


def _content_findings(report: ContentReport, *, quick: bool) -> Iterator[DoctorFinding]:
    for words in report.problems:
        yield problem("contents", words, _WRONG)
    if report.missing:
        names = ", ".join(name[:12] for name in report.missing[:3])
        yield problem(
            "contents",
            f"{len(report.missing)} scenes or files of runs that wait are gone: {names}",
            "submit their campaigns again: what is missing is sent along",
        )
    if not report.problems and not report.missing:
        counts = f"{report.results} results, {report.specifications} specifications"
        if quick:
            words = f"the newest {counts} agree with their digests"
        else:
            words = f"{counts}, {report.scenes} scenes and {report.files} files agree with their "
            words += f"digests, {report.traces} traces with what was recorded"
        yield ok("contents", words)
