"""What is exported of recorded runs: their traces, and pictures of single ones."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli.exit_codes import ExitCode, wrong_usage
from scenario_tui.cli.options import check_folder, check_writable
from scenario_tui.cli.output import Output, OutputPart, say, stdout_console

if TYPE_CHECKING:
    from collections.abc import Sequence

    from daemon.batch.stores import TraceReference
    from daemon.model.status import RunRow
    from scenario_tui.cli.target import DaemonTarget

RECORDED_KINDS: Final = ("picture", "traces")
PICTURE_ENDINGS: Final = (".svg", ".png", ".pdf")
_FILE_ENDINGS: Final = (".fpm", ".yaml", ".yml", ".json", ".jsonld", ".variation", ".scenery")
"""What ends so is a file of somebody, also where it is not there."""


class Brought(OutputPart):
    """A trace that is here now."""

    run: str
    path: str
    bytes: int
    sha256: str


WallClockOption = Annotated[
    bool,
    typer.Option(
        "--wall-clock",
        help="For traces: write NAME.wall.mcap instead, whose metadata says when the run began.",
    ),
]


class FetchOutput(Output, schema="fetch"):
    """Traces that are here now, and why those that are ``missing`` are not."""

    traces: list[Brought]
    missing: dict[str, str]
    bytes: int
    seconds: float

    def print(self) -> None:
        """Print how much it was and where it lies."""
        from grammars.text.words import count_noun
        from scenario_tui.text.formatting import time_text

        folders = ", ".join(sorted({str(Path(one.path).parent) for one in self.traces}))
        where = f" in {folders}" if folders else ""
        count, size = count_noun(len(self.traces), "trace"), self.bytes / 1e6
        words = f"{count}{where}, {size:.1f} MB, {time_text(self.seconds)}"
        stdout_console().print(words, markup=False, soft_wrap=True)


def _fetch(
    subject: str, folder: Path, wall_clock: bool, target: DaemonTarget, *, as_json: bool
) -> None:
    """Bring the traces of a campaign or a run here, from a daemon or the store they lie in.

    Each is verified. What was interrupted goes on where it was; what is here already stays.
    """
    from daemon.batch.errors import TraceUnavailable
    from daemon.batch.stores import copy_trace, local_copy, trace_reference
    from daemon.model.ids import trace_name
    from scenario_tui.cli.named_traces import recorded_runs, transfer_progress

    # All are asked for first, so that the bar knows how much there is to come.
    begun = time.perf_counter()
    wanted: list[tuple[TraceReference, Path]] = []
    executed: dict[str, RunRow] = {}
    missing: dict[str, str] = {}
    brought: list[Brought] = []
    with target.open() as daemon:
        for row in recorded_runs(daemon, subject, target, "SOURCE"):
            try:
                name = trace_name(row.campaign, row.scenario, row.sut, row.repeat)
                wanted.append((trace_reference(row), folder / name))
                executed[row.id] = row
            except TraceUnavailable as error:
                missing[row.id] = str(error)
        with transfer_progress(sum(trace.size for trace, _ in wanted)) as advance:
            for trace, path in wanted:
                try:
                    if not wall_clock:
                        copy_trace(trace, daemon, path, progress=advance)
                        brought.append(Brought(trace.run, str(path), trace.size, trace.sha256))
                        continue
                    original = local_copy(trace, daemon, progress=advance)
                    found = _with_wall_clock(executed[trace.run], original, path)
                    brought.append(found)
                except TraceUnavailable as error:
                    missing[trace.run] = str(error)
    for why in missing.values():
        say(why)
    size = sum(one.bytes for one in brought)
    FetchOutput(brought, missing, size, time.perf_counter() - begun).show(as_json)
    raise typer.Exit(ExitCode.INFRASTRUCTURE if missing or not brought else ExitCode.EXPECTED)


def _with_wall_clock(run: RunRow, original: Path, path: Path) -> Brought:
    """Write the copy of a trace that says when its run began, beside where it would have gone."""
    from daemon.batch.errors import TraceUnavailable
    from daemon.batch.stores import file_sha256
    from daemon.trace import copy_with_wall_clock

    if run.result is None or not run.result.timing.started:
        raise TraceUnavailable(f"{run.id}: nobody kept when it began; run it again to know")
    copy = path.with_name(f"{path.stem}.wall.mcap")
    copy_with_wall_clock(original, copy, run.result.timing.started, worker=run.worker)
    return Brought(run.id, str(copy), copy.stat().st_size, file_sha256(copy))


class PictureOutput(Output, schema="picture"):
    """A run that was drawn."""

    trace: str
    written: str

    def print(self) -> None:
        """Print the name of the file."""
        stdout_console().print(self.written, markup=False, soft_wrap=True)


def _draw(
    run: str,
    path: Path,
    target: DaemonTarget,
    part: tuple[float | None, float | None],
    *,
    as_json: bool,
) -> None:
    """Draw a run, the ``part`` of it between two moments in seconds if they are given."""
    from daemon.analysis.report.run_maps import draw_run
    from scenario_tui.cli.named_traces import one_trace

    if path.suffix not in PICTURE_ENDINGS:
        raise typer.BadParameter(f"{path} must end in .svg, .png or .pdf", param_hint="--out")
    check_writable(path, "--out")
    trace = one_trace(run, target, "SOURCE")
    with wrong_usage("--from, --until"):
        draw_run(trace, path, since=part[0], until=part[1])
    PictureOutput(str(trace), str(path)).show(as_json)


def is_recorded(source: Path) -> bool:
    """Whether a name is that of a trace, a run or a campaign that was submitted, not of a file."""
    if source.suffix == ".mcap":
        return True
    return not source.exists() and source.suffix not in _FILE_ENDINGS and len(source.parts) == 1


def export_recorded(
    source: Path,
    kinds: Sequence[str],
    out: Path,
    target: DaemonTarget,
    part: tuple[float | None, float | None],
    wall_clock: bool,
    *,
    as_json: bool,
) -> None:
    """Write the traces of recorded runs into the folder ``out``, or the picture of one run.

    Raises wrong usage for other kinds, and for both at a time.
    """
    if len(kinds) != 1 or kinds[0] not in RECORDED_KINDS:
        other = [kind for kind in kinds if kind not in RECORDED_KINDS]
        about = f"{other[0]} is of a building or a campaign file, and {source} is no file: of"
        message = f"{about if other else 'of'} recorded runs there are `picture` and `traces`"
        raise typer.BadParameter(f"{message}, one at a time", param_hint="KIND")
    if kinds[0] == "traces":
        if part != (None, None):
            raise typer.BadParameter("goes with picture only", param_hint="--from, --until")
        check_folder(out, "--out")
        _fetch(str(source), out, wall_clock, target, as_json=as_json)
        return
    if wall_clock:
        raise typer.BadParameter("goes with traces only", param_hint="--wall-clock")
    path = out
    if out.is_dir() or not out.suffix:
        path = out / f"{source.name.removesuffix('.mcap')}.svg"
    _draw(str(source), path, target, part, as_json=as_json)
