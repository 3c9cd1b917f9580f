"""From a campaign file to a submission: load, check and expand it.

The languages take 100 MB and keep a core busy: the dashboard has its child process do it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from daemon.batch.errors import DaemonError
from daemon.model.status import SubmissionReceipt
from daemon.model.submission import Submission
from grammars.text.diagnostics import Finding, InputError, Severity
from grammars.text.words import command_line, count_noun, duration_text
from scenario_tui.campaign_files import is_campaign

if TYPE_CHECKING:
    from daemon.batch.ledger import Forecast


def searches_text(path: Path, names: tuple[str, ...]) -> str:
    """Return a sentence with the searches of a campaign and their command, empty without any."""
    if not names:
        return ""
    if len(names) == 1:
        return f"{names[0]} is a search: start it with `{command_line('search', path)}`"
    command = command_line("search", path, names[0])
    return f"{', '.join(names)} are searches: start one with `{command}`"


def receipt_text(receipt: SubmissionReceipt) -> str:
    """Return the answer to a submission in words."""
    runs = count_noun(receipt.runs, "run")
    if receipt.known:
        return f"{receipt.campaign} exists already, its {runs} are kept (--fresh runs them anew)"
    cached = f", {receipt.cached:,} cached (--fresh runs them anew)" if receipt.cached else ""
    return f"submitted {receipt.campaign}: {runs}{cached}"


@dataclass(frozen=True, slots=True)
class Workload:
    """Runs to execute, for which one worker needs ``seconds``.

    ``untimed`` runs are left out of these, because no similar run exists.
    """

    runs: int
    seconds: float
    untimed: int


@dataclass(frozen=True, slots=True)
class SubmissionPlan:
    """Runs of a campaign: ``cells`` times ``repeats``, 0 when cells differ in these.

    ``new`` are the runs without a result, ``fresh`` all of them; ``None`` without a ledger.
    """

    cells: int
    repeats: int
    runs: int
    new: Workload | None = None
    fresh: Workload | None = None


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A file in a few words, the findings about it, and its submission, if requested.

    A campaign without errors has a plan and the names of its searches.
    """

    about: str = ""
    findings: tuple[Finding, ...] = ()
    submission: Submission | None = None
    plan: SubmissionPlan | None = None
    searches: tuple[str, ...] = ()


def check_file(
    path: Path, *, submit: bool = False, fresh: bool = False, state: Path | None = None
) -> CheckedFile:
    """Examine a file; with ``submit`` return the submission, ``fresh`` under a new id.

    ``state`` is the state directory of a daemon of this machine, whose ledger knows earlier runs.
    """
    from scenario_tui.library import checking
    from scenario_tui.library.campaign import load

    try:
        if not (submit or is_campaign(path)):
            return CheckedFile(*checking.check_file(path))
        campaign = load(path)
        if submit:
            return CheckedFile("", campaign.findings, campaign.submission(fresh=fresh))
        findings = tuple(campaign.check())
        has_errors = any(one.severity is Severity.ERROR for one in findings)
        plan = None if has_errors else _plan(campaign.submission(), state)
        about = checking.campaign_words(campaign)
    except InputError as error:
        return CheckedFile("", error.findings)
    return CheckedFile(about, findings, None, plan, campaign.searches)


def _plan(submission: Submission, state: Path | None) -> SubmissionPlan:
    """Return the plan of a submission, with times from the ledger below ``state``."""
    cells = Counter(run.cell for run in submission.runs)
    repeats = set(cells.values())
    runs = len(submission.runs)
    plan = SubmissionPlan(len(cells), repeats.pop() if len(repeats) == 1 else 0, runs)
    forecast = None if state is None else _forecast(submission, state)
    if forecast is None:
        return plan
    pairs = zip(forecast.seconds, forecast.cached, strict=True)
    new = [seconds for seconds, is_cached in pairs if not is_cached]
    return replace(plan, new=_workload(new), fresh=_workload(forecast.seconds))


def _workload(seconds: Sequence[float | None]) -> Workload:
    times = [one for one in seconds if one is not None]
    return Workload(len(seconds), sum(times), len(seconds) - len(times))


def _forecast(submission: Submission, state: Path) -> Forecast | None:
    from daemon.batch.ledger import LedgerReader
    from daemon.batch.paths import StatePaths

    paths = StatePaths(state)
    if not paths.ledger.is_file():
        return None
    try:
        with LedgerReader.open(paths) as ledger:
            return ledger.forecast(submission)
    except DaemonError:
        return None  # the ledger is of another version


def plan_text(plan: SubmissionPlan, slots: int, *, fresh: bool = False) -> str:
    """Return a plan in words, with its duration for ``slots`` runs at a time."""
    cells, runs = count_noun(plan.cells, "cell"), count_noun(plan.runs, "run")
    words = f"{cells}, {runs}"
    if plan.repeats:
        words = f"{cells} × {count_noun(plan.repeats, 'repeat')} = {runs}"
    work = plan.fresh if fresh else plan.new
    if work is None:
        return words
    if not work.runs:
        return f"{words}, all cached: nothing is executed"
    if work.runs < plan.runs:
        words += f", {plan.runs - work.runs:,} cached"
    if work.untimed == work.runs:
        return f"{words}; their duration is unknown: no similar run yet"
    at_once = max(1, min(slots, work.runs))
    about = "at least" if work.untimed else "about"
    more = f", {work.untimed:,} of them unknown" if work.untimed else ""
    span = duration_text(work.seconds / at_once)
    return f"{words}; {about} {span} on {count_noun(at_once, 'slot')}{more}"
