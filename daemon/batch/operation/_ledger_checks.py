"""The doctor's checks of the ledger: its file, and the contents it records."""

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
    """Check the ledger's file and contents, and that ``now`` is not before its newest event.

    A ``quick`` look leaves most of the contents out; with ``traces`` all of them are read.
    """
    if not paths.ledger.exists():
        yield ok("ledger", "none yet: the first daemon makes it")
        return
    try:
        found = check_integrity(paths.ledger, quick=quick)
    except Unavailable as error:
        yield problem("ledger", str(error), "end what holds it: `fuser -v ledger.db` names it")
        return
    except DaemonError as error:
        yield problem("ledger", str(error), _BACKUP)
        return
    if not found.version:
        yield _empty_finding(paths)
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


def _empty_finding(paths: StatePaths) -> DoctorFinding:
    if any(any(folder.glob("*")) for folder in (paths.scenes, paths.traces)):
        words = "is empty, though scenes or traces lie beside it: what was recorded is gone"
        return problem("ledger", words, "restore a backup before a daemon starts here")
    return ok("ledger", "empty: the next daemon makes its tables")


def _ledger_finding(found: LedgerIntegrity) -> DoctorFinding:
    if found.version != SCHEMA_VERSION:
        return problem("ledger", schema_problem(found.version), SCHEMA_REMEDY)
    if found.damage:
        return problem("ledger", f"is damaged: {'; '.join(found.damage)}", _BACKUP)
    numbers = f"{found.runs} runs, {found.results} results"
    return ok("ledger", f"whole, schema {SCHEMA_VERSION}, {numbers}")


def _history_findings(found: LedgerIntegrity, now: float) -> Iterator[DoctorFinding]:
    if found.alarms:
        yield warning(
            "determinism",
            f"{found.alarms} times another execution of a run came out differently",
            f"see `scenario results --runs --filter {NONDETERMINISTIC}`",
        )
    if found.newest_event > now + _LEDGER_SKEW:
        yield problem(
            "clock",
            f"it is {found.newest_event - now:.0f} s before the ledger's newest event",
            "set the clock (timedatectl); times in lists are wrong until it has caught up",
        )
    else:
        yield ok("clock", "not before the ledger's newest event")


def _content_findings(report: ContentReport, *, quick: bool) -> Iterator[DoctorFinding]:
    for words, having in report.problems.items():
        yield problem("contents", f"{words}: {names(having)}", _WRONG)
    if report.missing:
        first = ", ".join(name[:12] for name in report.missing[:3])
        yield problem(
            "contents",
            f"{len(report.missing)} scenes or files of runs that wait are gone: {first}",
            "submit their campaigns again: what is missing is sent along",
        )
    for words in report.foreign:
        yield warning("contents", words.partition(": ")[0], words.partition(": ")[2])
    if not report.problems and not report.missing:
        looked = report.counts
        counts = f"{looked['results']} results, {looked['specifications']} specifications"
        if quick:
            words = f"the newest {counts} agree with their digests"
        else:
            words = f"{counts}, {looked['scenes']} scenes and {looked['files']} files agree with "
            words += f"their digests, {looked['traces']} traces with what was recorded"
        yield ok("contents", words)
