"""The command that searches a scenario for failures and writes the failing campaign file."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import typer

from grammars.text.words import count_noun, duration_text
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, CommandError, ExitCode, exit_code, wrong_usage
from scenario_tui.cli.options import Slots, check_campaign_file, out_folder, refuse_typed
from scenario_tui.cli.output import (
    plain_table,
    print_commands,
    report_findings,
    say,
    stdout_console,
)
from scenario_tui.source import DaemonTarget, find_campaign
from scenario_tui.text.formatting import glyph_word

if TYPE_CHECKING:
    from daemon.model.search import SearchSubmission, SearchTask
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import RunRow
    from daemon.model.verbs import DaemonClient
    from daemon.search.client import SearchClient
    from daemon.search.preparation import PreparedSearch
    from scenario_tui.cli.values import Searches, SearchResult

_PATIENCE: Final = 30.0
"""Seconds to wait for an answer of the daemon before the next attempt."""
_LOOK_EVERY: Final = 0.2
_LAYERS: Final = "campaign"


def search(
    context: typer.Context,
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN.yaml | SEARCH",
            help="A campaign file; or the id or name of a search of the daemon. "
            "Default: list all searches.",
            autocompletion=completion.offers(completion.campaigns, completion.campaign_files),
        ),
    ] = "",
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Search in the file. Default: the only one.")
    ] = "",
    budget: Annotated[
        str, typer.Option("-n", metavar="AMOUNT", help='200 (runs), "200 runs", "10 min", or both.')
    ] = "",
    stop: Annotated[
        str,
        typer.Option(metavar="RULE", help='"first failure", "5 failures", "when settled", budget.'),
    ] = "",
    method: Annotated[
        Literal["auto", "halton", "random", "tpe", "cma", "boundary"] | None,
        "Method of proposals. Default: that of the campaign file.",
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, max=2**63 - 1, metavar="N", help="Seed of the proposals.")
    ] = None,
    confirm: Annotated[
        int | None,
        typer.Option(min=0, max=100, metavar="N", help="Repeats that confirm a failure."),
    ] = None,
    fresh: Annotated[
        bool, "Start anew. Otherwise the same search continues where it stopped."
    ] = False,
    detach: Annotated[bool, "-d", "Run the search in the background."] = False,
    out: Annotated[
        Path | None,
        out_folder("Folder for the failing scenario. Default: scenario-results/search/SEARCH/."),
    ] = None,
    slots: Slots = None,
    *,
    target: DaemonTarget,
) -> Answer[SearchResult] | Answer[Searches]:
    """Search for values that make a scenario fail, and for the nearest failure.

    The search runs in this process, and the daemon executes its runs. If no daemon answers, one is
    started on this machine. After Ctrl-C the same command continues the search.
    """
    from scenario_tui.cli.values import Searches

    if not campaign:
        with target.open() as daemon:
            searches = daemon.searches()
        return Answer("searches", Searches(searches), partial(_print_searches, searches, target))
    file = Path(campaign)
    if not (file.suffix in (".yaml", ".yml") or file.is_file()):
        changes = ("budget", "stop", "method", "seed", "confirm", "fresh", "detach", "name")
        why = "applies to campaign files: an existing search keeps its settings"
        refuse_typed(context, changes, why)
        return _watch(target, _find_search(target, campaign), out)
    change = _read_changes(budget, stop, method, seed, confirm)
    prepared = _begin(file, name, change, target, slots, fresh=fresh)
    submission = prepared.submission
    if not detach:
        return _watch(target, submission.campaign, out, file, _client_of(prepared, target))
    with target.open() as daemon:
        row = daemon.searches(submission.campaign)[0]
    if not row.ended:
        row = _detach(submission, target, out)
    return replace(search_answer(row, (), target), code=ExitCode.EXPECTED)


def _watch(
    target: DaemonTarget,
    campaign: str,
    out: Path | None,
    file: Path | None = None,
    client: SearchClient | None = None,
) -> Answer[SearchResult]:
    """Watch a search to its end, write the failure it found, return its answer.

    ``file`` is its campaign file, if that is here. Ctrl-C ends the watching, and the search if its
    ``client`` runs in this process.
    """
    from scenario_tui.library.watching import WatchedSearch, watch

    if client is not None:
        client.start()
    try:
        row = watch(target.open, WatchedSearch(campaign, client, target.command))
    except KeyboardInterrupt:
        if client is not None:
            client.leave()
        again = target.command("search", *([file] if file else []), campaign)
        end = target.command("cancel", campaign)
        message = f"interrupted: continue it with `{again}`, end it with `{end}`"
        raise CommandError(message, ExitCode.INTERRUPTED) from None
    with target.open() as daemon:
        runs = daemon.all_runs(campaign, results=True)
    failing = write_found(row, out or Path("scenario-results") / "search" / campaign, file)
    return search_answer(row, runs, target, failing)


def search_answer(
    row: SearchRow, runs: tuple[RunRow, ...], target: DaemonTarget, failing: Path | None = None
) -> Answer[SearchResult]:
    """Return the answer about a search; ``failing`` is the campaign file of its failure."""
    from scenario_tui.cli.values import SearchResult

    value = SearchResult(row, runs, str(failing or ""))
    return Answer("search", value, partial(_print_search, value, target), search_code(row))


def _print_search(value: SearchResult, target: DaemonTarget) -> None:
    from scenario_tui.text.search_text import answer_lines, search_commands

    console = stdout_console()
    for line in answer_lines(value.search):
        console.print(line, soft_wrap=not console.is_terminal)
    console.print()
    print_commands(*search_commands(value.search, value.found, target.command))


def _print_searches(searches: tuple[SearchRow, ...], target: DaemonTarget) -> None:
    from rich.text import Text

    from daemon.search.answers.sentences import search_word
    from scenario_tui.text.search_text import search_line

    console = stdout_console()
    if not searches:
        console.print("No searches yet. Write `search:` into a campaign file, then type:")
        print_commands((target.command("search", "campaign.yaml"), "its only search"))
        return
    table = plain_table("search", "", "state")
    for row in searches:
        word = search_word(row)
        state = Text(glyph_word(word), style=word)
        table.add_row(Text(row.campaign), state, Text(search_line(row)))
    console.print(table)
    print_commands((target.command("search", searches[0].campaign), "its answer"))


def wait_for_search(
    target: DaemonTarget, campaign: str, *, patience: float, limit: float = inf
) -> Answer[SearchResult]:
    """Watch a search to its end or for ``limit`` seconds; return its answer as one line."""
    from scenario_tui.library.watching import WatchedSearch, ask_patiently, watch
    from scenario_tui.text.search_text import search_line

    work = WatchedSearch(campaign, command=target.command)
    row = watch(target.open, work, patience=patience, limit=limit)
    runs = ask_patiently(target, lambda daemon: daemon.all_runs(campaign, results=True), patience)
    line = f"{row.campaign}: {search_line(row)}"
    return replace(search_answer(row, runs, target), text=partial(say, line))


def search_code(row: SearchRow) -> ExitCode:
    """Return the exit code of a search: 1 if it found a failure, 3 if it broke off.

    A search is inconclusive if it has not ended, was cancelled, or has only inconclusive runs.
    """
    from daemon.search.answers.sentences import search_word

    return exit_code([search_word(row)]) if row.ended else ExitCode.INCONCLUSIVE


def _read_changes(
    budget: str, stop: str, method: str | None, seed: int | None, confirm: int | None
) -> Callable[[SearchTask], SearchTask]:
    """Return a function that applies the options to a task; raises ``typer.BadParameter``."""
    from daemon.campaign import LEAST_CONFIRMED, read_budget, read_stop

    changes: dict[str, object] = {}
    if budget:
        with wrong_usage("--budget"):
            text = f"{budget.strip()} runs" if budget.strip().isdecimal() else budget
            changes["runs"], changes["seconds"] = read_budget(text)
    if stop:
        with wrong_usage("--stop"):
            changes["stop"], changes["failures"] = read_stop(stop)
    if method:
        changes["method"] = method
    if seed is not None:
        changes["seed"] = seed

    def change(task: SearchTask) -> SearchTask:
        if confirm is not None:
            changes["confirm"] = max(confirm, 0 if task.repeatable else LEAST_CONFIRMED)
        return replace(task, **changes)  # type: ignore[arg-type]

    return change


def _begin(
    path: Path,
    name: str,
    change: Callable[[SearchTask], SearchTask],
    target: DaemonTarget,
    slots: int | None,
    *,
    fresh: bool,
) -> PreparedSearch:
    """Begin a search in the daemon or continue it, with a message about it."""
    from daemon.batch.errors import Unreachable
    from daemon.search.client import client_name
    from daemon.search.preparation import prepare_search
    from scenario_tui.library.job import start_daemon_if_needed
    from scenario_tui.library.watching import SUBMIT_PATIENCE, ask_patiently

    check_campaign_file(path)

    def find(id_: str) -> SearchRow | None:
        with suppress(Unreachable), target.open() as daemon:
            return daemon.search_row(id_)
        return None

    prepared = prepare_search(
        path, name, client=client_name(), change=change, find=find, fresh=fresh
    )
    submission = prepared.submission
    report_findings(prepared.warnings)
    start_daemon_if_needed(target, slots)

    def begin(daemon: DaemonClient) -> tuple[SearchRow | None, SearchRow]:
        # The state before it begins: a cancelled search has another state afterwards.
        return daemon.search_row(submission.campaign), daemon.begin_search(submission)

    before, after = ask_patiently(target, begin, SUBMIT_PATIENCE)
    say(_receipt_text(submission, before))
    if after.client not in ("", submission.client):
        say(f"{after.client} runs it: watching, and taking over if that leaves")
    return prepared


def _client_of(prepared: PreparedSearch, target: DaemonTarget) -> SearchClient:
    """Return the client that runs a search in this process."""
    from daemon.batch.client import Client
    from daemon.search.client import SearchClient
    from daemon.search.program import run_search

    return SearchClient(
        Client.open(target.endpoint, timeout=_PATIENCE),
        prepared.submission,
        lambda runs: run_search(prepared.case, runs),
    )


def _detach(submission: SearchSubmission, target: DaemonTarget, out: Path | None) -> SearchRow:
    """Start a process that runs a search; return the state once the search has begun."""
    from daemon.batch.errors import LaunchFailed
    from daemon.batch.launch import start_detached
    from daemon.model.execution import python_command

    words = ["search", submission.file, submission.campaign, *target.words]
    words += ["--out", str(out)] if out is not None else []
    target.paths.make_folders()
    command = python_command("-c", "from scenario_tui.cli import main; main()", *words)
    process = start_detached(command, target.paths.search_log)
    with target.open() as daemon:
        while True:
            ended = process.poll() is not None
            row = daemon.searches(submission.campaign)[0]
            if row.client or row.ended:
                return row
            if ended:
                raise LaunchFailed(f"the search did not begin, see {target.paths.search_log}")
            time.sleep(_LOOK_EVERY)


def _receipt_text(submission: SearchSubmission, before: SearchRow | None) -> str:
    """Return the message about a search that was submitted."""
    task, id_ = submission.task, submission.campaign
    if before is None:
        about = f"{count_noun(len(task.parameters), 'parameter')} of {task.scenario}"
        time_limit = f" or {duration_text(task.seconds)}" if task.seconds else ""
        runs = count_noun(task.runs, "run")
        return f"submitted {id_}: {about}, at most {runs}{time_limit}"
    anew = "(--fresh starts anew)"
    runs = count_noun(before.finished, "run")
    if before.state == "finished":
        return f"{id_} exists already, its answer is kept {anew}"
    return f"{id_} exists already and continues after {runs} {anew}"


def _find_search(target: DaemonTarget, name: str) -> str:
    """Return the id of a search by its id or name."""
    with target.open() as daemon:
        row = find_campaign(daemon, name)
    if not row.search:
        results = target.command("results", name)
        raise CommandError(f"{name} is not a search: `{results}` shows its results")
    return row.id


def write_found(row: SearchRow, folder: Path, campaign: Path | None) -> Path | None:
    """Write the failure that a search found below a folder; return its campaign file.

    The file lies beside copies of the layers of ``campaign``, so that the folder can be passed on.
    If ``campaign`` is not here, the result is the file written before, if any.
    """
    from grammars.text.files import write_atomically
    from templates.naming import file_name

    name, answer = f"{file_name(row.task.name)}.found.yaml", row.answer
    if answer is None or not answer.found:
        return None
    if campaign is None:
        return next(iter(sorted((folder / _LAYERS).rglob(name))), None)
    path = copy_campaign(campaign, folder / _LAYERS) / name
    write_atomically(path, answer.found.encode("utf-8"))
    return path


def copy_campaign(path: Path, folder: Path) -> Path:
    """Copy all files of a campaign below ``folder``; return its folder there.

    The copies keep their relative places; shipped layers go beside the campaign, where it looks
    first. Raises :class:`grammars.text.diagnostics.InputError`, and ``OSError``.
    """
    from daemon.campaign import load_campaign
    from grammars.text.sources import recording_reads, shipped_folder

    # Resolve links in its folder, because ".." after a link leads elsewhere.
    file = path.parent.resolve() / path.name
    with recording_reads() as read:
        load_campaign(file)
    places = {Path(os.path.normpath(one.absolute())) for one in (file, *read)}
    shipped = shipped_folder()
    # A campaign that ships itself keeps its layers where they are.
    own = file.parent.is_relative_to(shipped)
    ships = {place for place in places if not own and place.is_relative_to(shipped)}
    root = os.path.commonpath([place.parent for place in places - ships])
    beside = folder / file.parent.relative_to(root)
    for place in places:
        target = (
            beside / place.relative_to(shipped)
            if place in ships
            else folder / place.relative_to(root)
        )
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(place, target)
    return beside
