"""The doctor's checks of the ledger: its file and its contents."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from daemon.batch.errors import DaemonError, Unavailable
from daemon.batch.ledger import (
    SCHEMA_REMEDY,
    SCHEMA_VERSION,
    ContentReport,
    LedgerIntegrity,
    VerificationProgress,
    check_integrity,
    schema_problem,
    verify_contents,
)
from daemon.batch.operation._findings import DoctorFinding, names, ok, problem, warning
from daemon.batch.paths import StatePaths
from daemon.model.status import NONDETERMINISTIC

# Seconds: a clock under correction may be a little behind its earlier time.
_LEDGER_SKEW: Final = 5.0
_BACKUP: Final = (
    "stop the daemon, keep a copy of the directory, restore the ledger from a backup "
    "or save the readable part with `sqlite3 ledger.db .recover`"
)
_WRONG: Final = (
    "recorded data was changed: restore a backup, "
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
        yield problem("contents", f"{words}: {names(places)}", _WRONG)
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
