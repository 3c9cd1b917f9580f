"""The command that brings traces from where they lie."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._exits import ExitCode
from scenario_tui.cli._options import AsJson, Connect, State

if TYPE_CHECKING:
    from daemon.store import Recorded


def fetch(
    subject: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN|RUN",
            help="Id or name of a campaign, or the id of a run.",
            autocompletion=_completion.runs,
        ),
    ],
    folder: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="DIR", file_okay=False,
            help="Folder to write to, one folder per campaign in it.",
        ),
    ] = Path(),
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Bring the traces of a campaign or a run here, from a daemon or the store they lie in.

    Each is verified. What was interrupted goes on where it was; what is here already stays.
    """
    from daemon.errors import NotAtHand
    from daemon.places import trace_name
    from daemon.store import bring, recorded
    from scenario_tui.cli._chosen import progress, recorded_runs
    from scenario_tui.cli._output import say
    from scenario_tui.cli._session import Target

    begun = time.perf_counter()
    wanted: list[tuple[Recorded, Path]] = []
    missing: dict[str, str] = {}
    with Target(connect, state).open() as daemon:
        for run in recorded_runs(daemon, subject):
            row = run.row
            try:
                name = trace_name(row.campaign, row.scenario, row.sut, row.repeat)
                wanted.append((recorded(run), folder / name))
            except NotAtHand as error:
                missing[row.id] = str(error)
        with progress(sum(trace.size for trace, _ in wanted)) as told:
            for trace, path in wanted:
                try:
                    bring(trace, daemon, path, told=told)
                except NotAtHand as error:
                    missing[trace.run] = str(error)
    for why in missing.values():
        say(why)
    brought = [(trace, path) for trace, path in wanted if trace.run not in missing]
    _tell(brought, missing, time.perf_counter() - begun, as_json=as_json)
    raise typer.Exit(ExitCode.INFRASTRUCTURE if missing or not brought else ExitCode.EXPECTED)


def _tell(
    brought: list[tuple[Recorded, Path]], missing: dict[str, str], seconds: float, *, as_json: bool
) -> None:
    from scenario_tui.cli._output import emit, out
    from scenario_tui.wording import counted

    size = sum(trace.size for trace, _ in brought)
    if as_json:
        traces = [
            {"run": trace.run, "path": str(path), "bytes": trace.size, "sha256": trace.sha256}
            for trace, path in brought
        ]
        emit("fetch", traces=traces, missing=missing, bytes=size, seconds=seconds)
        return
    folders = ", ".join(sorted({str(path.parent) for _, path in brought}))
    where = f" in {folders}" if folders else ""
    words = f"{counted(len(brought), 'trace')}{where}, {size / 1e6:.1f} MB, {seconds:.1f} s"
    out().print(words, markup=False, soft_wrap=True)
