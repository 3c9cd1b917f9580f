"""The command that says why a run fails."""

from __future__ import annotations

import shlex
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.completion import campaign_files
from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.options import AsJson, State
from scenario_tui.cli.output import Output, say, stderr_console, stdout_console

if TYPE_CHECKING:
    from daemon.analysis.blame import Blame, CandidateRunner, RunCase
    from scenario_tui.cli.target import DaemonTarget


class BlameOutput(Output, schema="blame"):
    """Causes of a failure, the effort to find them, and the file of the least that fails."""

    blame: Blame
    runs: int
    cached: int
    seconds: float
    saved: str


def blame(
    run: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN | CAMPAIGN.yaml SCENARIO [SUT [REPEAT]]",
            help="A failed run: its trace (.mcap), its id, or its place in a campaign file.",
            autocompletion=completion.blame_arguments,
        ),
    ],
    oracle: Annotated[
        str,
        typer.Option(
            "--oracle",
            help="The verdict to explain. Default: the first failing.",
            autocompletion=completion.oracles,
        ),
    ] = "",
    runs: Annotated[
        int, typer.Option("--runs", "-n", min=1, max=100_000, help="At most so many runs.")
    ] = 100,
    campaign: Annotated[
        Path | None,
        typer.Option(
            "--campaign",
            metavar="FILE",
            help="Campaign file of a trace or id. Default: the file it was run from.",
            autocompletion=completion.files(campaign_files),
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Where the smallest failing scenario goes. Default: scenario-results/blame/RUN/.",
        ),
    ] = None,
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Find the layer or parameter that makes a run fail, and the least that still fails.

    Runs are executed here, two at a time. Ctrl-C keeps what was found.
    """
    from daemon.analysis.blame import (
        BudgetSpentError,
        CandidateRunner,
        NoFailureError,
        explain_failure,
        save_campaign,
    )

    case, note = _find_case(run, state, campaign)
    if note:
        say(f"{case.spec.label}: {note}")
    if not case.spec.sut.repeatable:
        # Each candidate is run once: what passes by luck would be called the reason.
        say(f"{case.spec.sut.name} is not repeatable: a reason found here may be chance, verify it")
    try:
        # Saving is inside: whether the first repeat fails as well may be one more run.
        with _RunCounter() as watch:
            runner = CandidateRunner(runs, watch=watch)
            result = explain_failure(case, runner, oracle)
            file = save_campaign(case, result, out or _folder(case), runner)
    except NoFailureError as error:
        # Nothing is wrong with what was typed: there is just no failure to explain.
        say(f"scenario: {error}")
        raise typer.Exit(ExitCode.INCONCLUSIVE) from error
    except BudgetSpentError as error:
        raise typer.BadParameter("not even the run itself fits", param_hint="--runs") from error
    if as_json:
        BlameOutput(result.story, runner.runs, runner.cached, runner.seconds, str(file)).emit()
    else:
        _print_blame(case, result.story, runner, file)
    raise typer.Exit(
        ExitCode.INTERRUPTED if result.story.stopped == "interrupted" else ExitCode.EXPECTED
    )


def _find_case(words: list[str], state: Path | None, campaign: Path | None) -> tuple[RunCase, str]:
    """Return the run that ``words`` name, taken apart, and how it differs from the recorded one.

    For a trace or an id the layers are needed that a trace does not hold: those of ``campaign``,
    otherwise of the campaign file that the record of the run names, as long as it specifies that
    very run.
    """
    from daemon.analysis.blame import load_case
    from daemon.trace import read_spec
    from scenario_tui.cli.named_traces import one_trace
    from scenario_tui.cli.suggestions import refuse_missing_file
    from scenario_tui.cli.target import DaemonTarget

    first, *rest = words
    refuse_missing_file(first)
    if first.endswith((".yaml", ".yml")):
        return load_case(Path(first), *_place_in_campaign(rest)), ""
    if rest:
        message = "one trace or one id of a run, or CAMPAIGN.yaml SCENARIO SUT REPEAT"
        raise typer.BadParameter(message, param_hint="RUN")
    target = DaemonTarget(state=state)
    trace = one_trace(first, target, "RUN")
    spec = read_spec(trace)
    recorded = _recorded_file(first, trace, target)
    file = campaign or _existing_file(recorded, trace)
    case = load_case(file, spec.scenario, spec.sut.name, spec.repeat)
    if case.spec.digest == spec.digest:
        return case, ""
    if campaign is None:
        hint = f"say --campaign {file} to ask about the run as its layers are now"
        message = f"{file} does not specify this run any more: {hint}"
        raise typer.BadParameter(message, param_hint="RUN")
    return case, "its layers have changed since: this is about the run as they are now"


def _place_in_campaign(words: list[str]) -> tuple[str, str, int]:
    """Return scenario, system under test and repeat; the system is empty for the only one."""
    if not 1 <= len(words) <= 3:
        message = "name a run of the campaign: SCENARIO SUT REPEAT, such as S1 pilot 0"
        raise typer.BadParameter(message, param_hint="RUN")
    scenario, sut, repeat = (*words, *("", "0")[len(words) - 1 :])
    if not repeat.isdecimal():
        message = f"{repeat} is not the number of a repeat, they count from 0"
        raise typer.BadParameter(message, param_hint="RUN")
    return scenario, sut, int(repeat)


def _recorded_file(name: str, trace: Path, target: DaemonTarget) -> str:
    """Return the campaign file that the record of a run names, empty without one.

    The record is the note of ``scenario run`` beside the trace, otherwise the ledger. Raises wrong
    usage for a run of a search, which no campaign file specifies.
    """
    from daemon.analysis.results import read_campaign_note
    from daemon.batch.errors import DaemonError
    from scenario_tui.cli.named_traces import names_traces, open_records
    from scenario_tui.cli.target import find_campaign

    origin, campaign, is_search = read_campaign_note(trace.parent).origin, trace.parent.name, False
    with suppress(DaemonError, typer.BadParameter), open_records("", target, "RUN") as source:
        if not names_traces(name):
            campaign = find_campaign(source, name.partition(".")[0]).id
        is_search = bool(campaign and source.searches(campaign))
        origin = origin if origin.path else source.origin(campaign)
    if is_search:
        folder = f"scenario-results/search/{campaign}/campaign/"
        message = f"{name} is a run of a search: name the scenario it found, a campaign in {folder}"
        raise typer.BadParameter(message, param_hint="RUN")
    return origin.path


def _existing_file(recorded: str, trace: Path) -> Path:
    """Return the recorded campaign file; wrong usage if there is none any more."""
    if recorded and Path(recorded).is_file():
        return Path(recorded)
    problem = f"no record names the campaign file of {trace}"
    if recorded:
        problem = f"there is no {recorded} any more"
    raise typer.BadParameter(f"{problem}: say --campaign FILE", param_hint="RUN")


def _folder(case: RunCase) -> Path:
    from daemon.model.ids import trace_name

    spec = case.spec
    name = trace_name(case.campaign.name, spec.scenario, spec.sut.name, spec.repeat)
    return Path("scenario-results") / "blame" / name.removesuffix(".mcap")


class _RunCounter:
    """Counter of the runs so far, on one line of a terminal.

    It has no thread, since runs are forked, and threads do not survive that.
    """

    def __init__(self) -> None:
        self._console = stderr_console()
        # Where the line cannot be written again, every count would be a line of its own.
        self._moves = self._console.is_terminal and not self._console.is_dumb_terminal

    def __enter__(self) -> _RunCounter:
        return self

    def __call__(self, runner: CandidateRunner) -> None:
        self._show(f"{runner.runs} runs, {runner.seconds:.0f} s")

    def __exit__(self, *_: object) -> None:
        # Erased, not ended: what follows is the answer, and the count is in it.
        self._show("")

    def _show(self, text: str) -> None:
        if self._moves:
            self._console.file.write(f"\r{text}\x1b[K")
            self._console.file.flush()


def _print_blame(case: RunCase, story: Blame, runner: CandidateRunner, file: Path) -> None:
    from daemon.analysis.blame import story_lines
    from grammars.text.words import count_noun, duration_text
    from scenario_tui.cli.results import print_commands
    from scenario_tui.text.formatting import verdict_line

    console = stdout_console()
    console.print(f"{story.run} fails {verdict_line(story.verdict)}", soft_wrap=True)
    console.print()
    for line in story_lines(story, case.settings.like):
        console.print(f"  {line}", soft_wrap=True)
    console.print()
    if story.stopped:
        console.print(f"stopped before nothing else could go: {story.stopped}")
    took = f"{count_noun(runner.runs, 'run')}, {duration_text(runner.seconds)}"
    console.print(f"{took}; {runner.cached} more were known already")
    print_commands(
        (f"scenario run {shlex.quote(str(file))}", "the smallest failing scenario, on its own")
    )
