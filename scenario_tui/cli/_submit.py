"""Submitting to a daemon and staying until the end."""

from __future__ import annotations

from daemon.launch import ensure_daemon, running_daemon
from daemon.places import Places, endpoint_text
from scenario_tui.cli._compare import print_between
from scenario_tui.cli._exits import ExitCode
from scenario_tui.cli._gate import final_code, hold
from scenario_tui.cli._output import say
from scenario_tui.cli._progress import watch
from scenario_tui.cli._session import Target
from scenario_tui.cli._summary import print_commands, print_summary
from scenario_tui.cli._told import emit_results
from scenario_tui.summary import gather


def start_daemon_if_needed(target: Target, slots: int | None) -> None:
    """See to it that the daemon answers; one is started unless people named it themselves."""
    if target.named:
        return
    state = Places.find(target.state).state
    if running_daemon(state) is None:
        where = endpoint_text(ensure_daemon(state, slots=slots))
        say(f"started a daemon on this machine at {where} (`scenario stop` ends it)")


def watch_to_the_end(
    target: Target, campaign: str, as_json: bool, baseline: str = "", worse_by: str | None = None
) -> int:
    """Watch a campaign, print its summary, return the exit code it deserves.

    Ctrl-C ends the watching only.
    """
    try:
        row = watch(target.open, campaign)
    except KeyboardInterrupt:
        say(f"\n{campaign} goes on; come back with `scenario tui` or `scenario results {campaign}`")
        return ExitCode.INTERRUPTED
    with target.open() as daemon:
        results = gather(daemon, row)
    between = hold(results, baseline, worse_by, target.open)
    if as_json:
        emit_results(results, comparison=between)
    else:
        took = (row.finished_at or row.submitted_at) - row.submitted_at
        print_summary(results, took=took)
        if between is not None:
            print_between(between)
        print_commands(
            ("scenario tui", "look at it in the dashboard"),
            (f"scenario results {campaign} --runs", "every run and its trace"),
        )
    return final_code(results, between)
