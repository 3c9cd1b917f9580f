"""The command that says why a run fails."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from daemon.batch.errors import DaemonError
from grammars.text.words import command_line, count_noun, duration_text
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, CommandError, ExitCode
from scenario_tui.cli.options import check_campaign_file, out_folder, refuse_missing_file
from scenario_tui.cli.output import open_progress, print_commands, print_line, say
from scenario_tui.source import DaemonTarget, find_run, one_trace, trace_files
from scenario_tui.text.formatting import verdict_line

if TYPE_CHECKING:
    from daemon.analysis.blame import CandidateRunner, Explanation, RunCase


def blame(
    run: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN | CAMPAIGN.yaml SCENARIO [SUT [REPEAT]]",
            help="A failed run: its trace (.mcap), its id, or its place in a campaign file.",
            autocompletion=completion.offers(
                completion.runs, completion.files(".mcap"), completion.campaign_files
            ),
        ),
    ],
    oracle: Annotated[
        str,
        typer.Option(
            help="Verdict to explain. Default: the first failing one.",
            autocompletion=completion.offers(completion.oracles),
        ),
    ] = "",
    runs: Annotated[
        int, typer.Option("-n", min=1, max=100_000, help="Maximum number of runs.")
    ] = 100,
    campaign: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Campaign file of the trace or id. Default: the file that the run came from.",
            autocompletion=completion.offers(completion.campaign_files),
        ),
    ] = None,
    out: Annotated[
        Path | None,
        out_folder(
            "Folder for the smallest failing scenario. Default: scenario-results/blame/RUN/."
        ),
    ] = None,
    *,
    target: DaemonTarget,
) -> Answer[Explanation]:
    """Find the layer or parameter that makes a run fail, and the smallest failing scenario.

    The runs execute on this machine, two at a time. Ctrl-C keeps the findings so far.
    """
    from daemon.analysis.blame import (
        BudgetSpentError,
        CandidateRunner,
        Explanation,
        NoFailureError,
        explain_failure,
        save_campaign,
    )

    refuse_missing_file(run[0])
    is_file = run[0].endswith((".yaml", ".yml"))
    case = _written_case(run) if is_file else _recorded_case(run, target, campaign)
    if not case.spec.sut.repeatable:
        # Each candidate runs once, so a lucky pass would look like the reason.
        say(f"{case.spec.sut.name} is not repeatable: a reason found here may be chance, verify it")
    try:
        # The runs are forked processes; threads do not survive a fork.
        with open_progress("{task.description}", threads=False) as progress:
            task = progress.add_task("")

            def watch(runner: CandidateRunner) -> None:
                done = f"{count_noun(runner.runs, 'run')}, {duration_text(runner.seconds)}"
                progress.update(task, description=done, refresh=True)

            runner = CandidateRunner(runs, watch=watch)
            result = explain_failure(case, runner, oracle)
            # This may need one more run, to see whether the first repeat fails as well.
            file = save_campaign(case, result, out or _folder(case), runner)
    except NoFailureError as error:
        # The input is correct; there is just no failure to explain.
        raise CommandError(str(error), ExitCode.INCONCLUSIVE) from error
    except BudgetSpentError as error:
        message = "too few: the run itself needs more"
        raise typer.BadParameter(message, param_hint="--runs") from error
    story = result.story
    value = Explanation(story, runner.runs, runner.cached, runner.seconds, file)
    code = ExitCode.INTERRUPTED if story.stopped == "interrupted" else ExitCode.EXPECTED
    return Answer("blame", value, partial(_print, value, case.settings.like), code)


def _written_case(words: list[str]) -> RunCase:
    """Return the run that a campaign file, a scenario, a system and a repeat name.

    The system may be left out if there is only one; the default repeat is the first.
    """
    from daemon.analysis.blame import load_case

    file, *place = words
    if not 1 <= len(place) <= 3:
        message = "name a run of the campaign: SCENARIO SUT REPEAT, such as S1 pilot 0"
        raise typer.BadParameter(message, param_hint="RUN")
    scenario, sut, repeat = (*place, *("", "0")[len(place) - 1 :])
    if not repeat.isdecimal():
        message = f"{repeat} is not the number of a repeat; repeats count from 0"
        raise typer.BadParameter(message, param_hint="RUN")
    return load_case(Path(file), scenario, sut, int(repeat))


def _recorded_case(words: list[str], target: DaemonTarget, campaign: Path | None) -> RunCase:
    """Return the run of a trace or an id, with its layers.

    A trace does not hold layers. They come from ``campaign``, otherwise from the campaign file in
    the record of the run, as long as that file still specifies this very run.
    """
    from daemon.analysis.blame import load_case
    from daemon.trace import read_spec

    if len(words) > 1:
        message = "one trace or one id of a run, or CAMPAIGN.yaml SCENARIO SUT REPEAT"
        raise typer.BadParameter(message, param_hint="RUN")
    trace = one_trace(words[0], target)
    spec = read_spec(trace)
    recorded = _recorded_file(words[0], trace, target)
    file = check_campaign_file(campaign) if campaign else Path(recorded)
    if campaign is None and not (recorded and file.is_file()):
        problem = f"{recorded} does not exist any more"
        if not recorded:
            problem = f"no record names the campaign file of {trace}"
        raise typer.BadParameter(f"{problem}: name it with --campaign FILE", param_hint="RUN")
    case = load_case(file, spec.scenario, spec.sut.name, spec.repeat)
    if case.spec.digest != spec.digest:
        if campaign is None:
            hint = f"use --campaign {file} to explain the run with its present layers"
            message = f"{file} does not specify this run any more: {hint}"
            raise typer.BadParameter(message, param_hint="RUN")
        changed = "its layers have changed since; this explains the run with its present layers"
        say(f"{case.spec.label}: {changed}")
    return case


def _recorded_file(name: str, trace: Path, target: DaemonTarget) -> str:
    """Return the campaign file that the record of a run names, empty without a record.

    The record is the note of ``scenario run`` beside the trace, otherwise the submission.
    Raises wrong usage for a run of a search, which no campaign file specifies.
    """
    from daemon.analysis.results import read_campaign_note

    origin, campaign = read_campaign_note(trace.parent).origin, trace.parent.name
    is_search = False
    with suppress(DaemonError), target.read() as source:
        if not trace_files(name):
            campaign = find_run(source, name).row.campaign
        is_search = bool(source.searches(campaign))
        origin = origin if origin.path else source.origin(campaign)
    if is_search:
        folder = f"scenario-results/search/{campaign}/campaign/"
        message = f"{name} is a run of a search: name the scenario it found, a campaign in {folder}"
        raise typer.BadParameter(message, param_hint="RUN")
    return origin.path


def _folder(case: RunCase) -> Path:
    from daemon.model.ids import trace_name

    spec = case.spec
    name = trace_name(case.campaign.name, spec.scenario, spec.sut.name, spec.repeat)
    return Path("scenario-results") / "blame" / name.removesuffix(".mcap")


def _print(explanation: Explanation, like: str) -> None:
    from daemon.analysis.blame import story_lines

    story = explanation.blame
    print_line(f"{story.run} fails {verdict_line(story.verdict)}")
    print_line()
    for line in story_lines(story, like):
        print_line(f"  {line}")
    print_line()
    if story.stopped:
        print_line(f"stopped before the smallest scenario was found: {story.stopped}")
    took = f"{count_noun(explanation.runs, 'run')}, {duration_text(explanation.seconds)}"
    cached = f"; {explanation.cached} more had a result already" if explanation.cached else ""
    print_line(took + cached)
    command = command_line("run", explanation.saved)
    print_commands((command, "the smallest failing scenario, on its own"))
