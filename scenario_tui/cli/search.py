"""The command that searches a scenario for failures."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.exit_codes import ExitCode, exit_code, wrong_usage
from scenario_tui.cli.options import AsJson, Connect, Slots, State
from scenario_tui.cli.output import Output, plain_table, report_findings, say, stdout_console

if TYPE_CHECKING:
    from daemon.model.search import SearchSubmission, SearchTask
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import RunRow
    from daemon.model.verbs import DaemonClient
    from daemon.search.client import SearchClient
    from daemon.search.preparation import PreparedSearch
    from scenario_tui.cli.search_progress import SearchWatch
    from scenario_tui.cli.target import DaemonTarget

_PATIENCE: Final = 30.0
"""Seconds to wait for an answer of the daemon before it is asked again."""
_LOOK_EVERY: Final = 0.2


class SearchOutput(Output, schema="search"):
    """A search with its answer and its runs, and the files ``written`` about it by their kind.

    The files of the least that fails are among those, not in the answer.
    """

    search: SearchRow
    proposals: tuple[RunRow, ...]
    written: dict[str, str]

    def print(self) -> None:
        """Print the answer, what was written, and what to type next."""
        from scenario_tui.cli.results import print_commands
        from scenario_tui.cli.search_files import file_commands
        from scenario_tui.text.formatting import TERMINAL_STYLES
        from scenario_tui.text.search_text import answer_lines, search_commands

        console = stdout_console()
        for line in answer_lines(self.search, styles=TERMINAL_STYLES):
            console.print(line, soft_wrap=True)
        console.print()
        if page := self.written.get("page"):
            console.print(f"a page with figures: {page}", markup=False, soft_wrap=True)
        print_commands(*file_commands(self.written), *search_commands(self.search))


class SearchesOutput(Output, schema="searches"):
    """The searches a daemon has, the newest first; answers without their files."""

    searches: tuple[SearchRow, ...]

    def print(self) -> None:
        """Print a line for each."""
        from rich.text import Text

        from daemon.search.answers.sentences import search_word
        from scenario_tui.cli.results import print_commands
        from scenario_tui.text.formatting import TERMINAL_STYLES, glyph_word
        from scenario_tui.text.search_text import search_line

        console = stdout_console()
        if not self.searches:
            console.print("No searches yet. Type: scenario search CAMPAIGN.yaml")
            return
        table = plain_table("search", "", "how it stands")
        for row in self.searches:
            word = search_word(row)
            shown = Text(glyph_word(word), style=TERMINAL_STYLES[word])
            table.add_row(Text(row.campaign), shown, Text(search_line(row)))
        console.print(table)
        print_commands((f"scenario search {self.searches[0].campaign}", "its answer"))


def search(
    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN.yaml | SEARCH",
            help="A campaign file; or id or name of a search that the daemon has. "
            "Default: list those.",
            autocompletion=completion.campaign_files_or_campaigns,
        ),
    ] = "",
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="Which search of the file. Default: the only one.",
        ),
    ] = "",
    budget: Annotated[
        str,
        typer.Option(
            "--budget", "-n", metavar="AMOUNT", help='200 (runs), "200 runs", "10 min", or both.'
        ),
    ] = "",
    stop: Annotated[
        str,
        typer.Option(
            "--stop", metavar="RULE", help='"first failure", "5 failures", "when settled", budget.'
        ),
    ] = "",
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar="NAME",
            help="auto, halton, random, tpe, cma or boundary.",
            autocompletion=completion.one_of("auto", "halton", "random", "tpe", "cma", "boundary"),
        ),
    ] = "",
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=0, max=2**63 - 1, metavar="N", help="Seed of the proposals."),
    ] = None,
    confirm: Annotated[
        int | None,
        typer.Option(
            "--confirm", min=0, max=100, metavar="N", help="Repeats of a failure that is told."
        ),
    ] = None,
    fresh: Annotated[
        bool,
        typer.Option(
            "--fresh", help="Search anew. Otherwise the same search goes on where it stands."
        ),
    ] = False,
    detach: Annotated[
        bool, typer.Option("--detach", "-d", help="Let the search run in the background.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Where the found scenario, its world for Gazebo and a page with figures go. "
            "Default: scenario-results/search/SEARCH/.",
        ),
    ] = None,
    gazebo: Annotated[
        bool, typer.Option("--gazebo/--no-gazebo", help="Export the found world for Gazebo.")
    ] = True,
    listed: Annotated[bool, typer.Option("--list", help="List the searches there are.")] = False,
    slots: Slots = None,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Search for values that make a scenario fail, and for the failure nearest to it.

    The search runs here and has its runs executed by the daemon; one is started on this machine if
    none answers. After Ctrl-C the same command goes on where it was.
    """
    from scenario_tui.cli.search_progress import SearchWatch
    from scenario_tui.cli.target import DaemonTarget

    target = DaemonTarget(connect, state)
    if listed or not campaign:
        if campaign:
            raise typer.BadParameter("lists all of them: name none", param_hint="--list")
        with target.open() as daemon:
            SearchesOutput(daemon.searches()).show(as_json)
        return
    if not _is_file(campaign):
        changes = {"--budget": budget, "--stop": stop, "--method": method, "--seed": seed,
                   "--confirm": confirm, "--fresh": fresh or None, "--detach": detach or None,
                   "NAME": name}  # fmt: skip
        given = [option for option, value in changes.items() if value not in ("", None)]
        if given:
            message = "is for campaign files: a search that is there is shown as it was asked for"
            raise typer.BadParameter(message, param_hint=given[0])
        watched = SearchWatch(_find_search(target, campaign))
        raise typer.Exit(watch_search(target, watched, as_json, out=out, gazebo=gazebo))
    file = Path(campaign)
    change = _read_changes(budget, stop, method, seed, confirm)
    prepared = _begin(file, name, change, target, slots, fresh=fresh)
    submission = prepared.submission
    if detach:
        with target.open() as daemon:
            row = daemon.searches(submission.campaign)[0]
        if not row.ended:
            row = _detach(submission, target, out, gazebo=gazebo)
        search_output(row, ()).show(as_json)
        return
    client = _client_of(prepared, target)
    client.start()
    watched = SearchWatch(submission.campaign, client)
    raise typer.Exit(watch_search(target, watched, as_json, out=out, gazebo=gazebo, file=file))


def watch_search(
    target: DaemonTarget,
    watched: SearchWatch,
    as_json: bool,
    *,
    out: Path | None,
    gazebo: bool,
    file: Path | None = None,
) -> int:
    """Watch a search to its end, write its files, print its answer, return its exit code.

    ``file`` is its campaign file, if that is here. Ctrl-C ends the watching, and the search if it
    runs here.
    """
    from scenario_tui.cli.search_files import write_search_files
    from scenario_tui.library.watching import watch_work

    campaign = watched.campaign
    try:
        row = watch_work(target.open, campaign, watched)
    except KeyboardInterrupt:
        if watched.client is not None:
            watched.client.leave()
        words = ("scenario", "search", *([str(file)] if file is not None else []), campaign)
        again = shlex.join(words)
        say(f"\ngo on with `{again}`, end it with `scenario cancel {campaign}`")
        return ExitCode.INTERRUPTED
    with target.open() as daemon:
        folder = out or Path("scenario-results") / "search" / campaign
        written = write_search_files(daemon, row, watched.rows, folder, file, gazebo=gazebo)
    files = {kind: str(path) for kind, path in written.items()}
    search_output(row, watched.rows, files).show(as_json)
    return search_code(row)


def wait_for_search(
    target: DaemonTarget, campaign: str, as_json: bool, *, patience: float, limit: float
) -> int:
    """Watch a search to its end or for ``limit`` seconds, say how it stands; nothing is written."""
    from scenario_tui.cli.search_progress import SearchWatch
    from scenario_tui.library.watching import watch_work
    from scenario_tui.text.search_text import search_line

    watched = SearchWatch(campaign)
    row = watch_work(target.open, campaign, watched, patience=patience, limit=limit)
    if as_json:
        search_output(row, watched.rows).emit()
    say(f"{row.campaign}: {search_line(row)}")
    return search_code(row)


def search_code(row: SearchRow) -> ExitCode:
    """Return the exit code of a search: 1 when something fails, 3 when it could not go on.

    One that has not ended, was cancelled, or whose runs all were inconclusive, is not decided.
    """
    from daemon.search.answers.sentences import search_word

    return exit_code([search_word(row)]) if row.ended else ExitCode.INCONCLUSIVE


def _is_file(word: str) -> bool:
    return word.endswith((".yaml", ".yml")) or Path(word).is_file()


def _read_changes(
    budget: str, stop: str, method: str, seed: int | None, confirm: int | None
) -> Callable[[SearchTask], SearchTask]:
    """Return what options change of a search; raises :class:`typer.BadParameter`."""
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
        repeats = {} if confirm is None else {"confirm": confirm}
        if confirm is not None and not task.repeatable:
            repeats = {"confirm": max(confirm, LEAST_CONFIRMED)}
        return replace(task, **changes, **repeats)  # type: ignore[arg-type]

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
    """Begin a search in the daemon, or go on with it, and say so."""
    from daemon.batch.errors import Unreachable
    from daemon.search.client import client_name
    from daemon.search.preparation import prepare_search
    from scenario_tui.cli.execute import start_daemon_if_needed
    from scenario_tui.cli.suggestions import refuse_missing_campaign
    from scenario_tui.library.watching import SUBMIT_PATIENCE, ask_patiently

    refuse_missing_campaign(path)

    def find(id_: str) -> SearchRow | None:
        try:
            with target.open() as daemon:
                return daemon.search_row(id_)
        except Unreachable:
            return None

    prepared = prepare_search(
        path, name, client=client_name(), change=change, find=find, fresh=fresh
    )
    submission = prepared.submission
    report_findings(prepared.warnings)
    start_daemon_if_needed(target, slots)

    def begin(daemon: DaemonClient) -> tuple[SearchRow | None, SearchRow]:
        # Asked before: afterwards one that was cancelled goes on.
        return daemon.search_row(submission.campaign), daemon.begin_search(submission)

    before, after = ask_patiently(target, begin, SUBMIT_PATIENCE)
    say(_receipt_text(submission, before))
    if after.client not in ("", submission.client):
        say(f"{after.client} runs it: watching, and going on with it should that leave")
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


def _detach(
    submission: SearchSubmission, target: DaemonTarget, out: Path | None, *, gazebo: bool
) -> SearchRow:
    """Let a process of its own run a search; return how it stands once that has begun."""
    import time

    from daemon.batch.errors import LaunchFailed
    from daemon.batch.launch import start_detached
    from daemon.model.execution import python_command

    words = ["search", submission.file, submission.campaign, *target.words]
    words += ["--out", str(out)] if out is not None else []
    words += [] if gazebo else ["--no-gazebo"]
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
    """Say what became of a search that was handed over."""
    from grammars.text.words import count_noun

    task, id_ = submission.task, submission.campaign
    if before is None:
        about = f"{count_noun(len(task.parameters), 'parameter')} of {task.scenario}"
        return f"submitted {id_}: {about}, {_budget_text(task)}"
    anew = "(--fresh searches anew)"
    runs = count_noun(before.finished, "run")
    if before.state == "finished":
        return f"{id_} is known already, its answer is kept {anew}"
    return f"{id_} is known already and goes on after {runs} {anew}"


def _budget_text(task: SearchTask) -> str:
    from grammars.text.words import count_noun, duration_text

    runs = f"at most {count_noun(task.runs, 'run')}"
    return f"{runs} or {duration_text(task.seconds)}" if task.seconds else runs


def _find_search(target: DaemonTarget, wanted: str) -> str:
    """Return the id of the search meant; raises :class:`Refused` when there is none."""
    from daemon.batch.errors import Refused
    from scenario_tui.cli.search_report import find_search_id

    with target.open() as daemon:
        found = find_search_id(daemon, wanted)
    if not found:
        hint = f"its results are shown by `scenario results {wanted}`"
        raise Refused(f"{wanted} is no search: {hint}")
    return found


def search_output(
    row: SearchRow, rows: tuple[RunRow, ...], written: Mapping[str, str] | None = None
) -> SearchOutput:
    """Return what to say of a search, without the contents of files."""
    answer = row.answer
    if answer is not None and answer.shrunk is not None:
        shrunk = replace(answer.shrunk, files={})
        row = replace(row, answer=replace(answer, shrunk=shrunk))
    return SearchOutput(row, rows, dict(written or {}))
