"""Export of recorded runs: their traces, and pictures of single ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

import typer

from daemon.batch.errors import TraceUnavailable
from scenario_tui.cli.exit_codes import wrong_usage
from scenario_tui.cli.options import check_folder, check_writable
from scenario_tui.source import DaemonTarget, one_trace, recorded_runs, trace_files

if TYPE_CHECKING:
    from daemon.batch.stores import TraceReference

RECORDED_KINDS: Final = ("picture", "traces")
_PICTURE_ENDINGS: Final = (".svg", ".png", ".pdf")
_FILE_ENDINGS: Final = (".fpm", ".yaml", ".yml", ".json", ".jsonld", ".variation", ".scenery")
"""Endings of files that people write, for names of files that do not exist."""


@dataclass(frozen=True, slots=True)
class ExportedFiles:
    """Exported files, and the reasons why traces are ``missing`` by their runs."""

    files: tuple[Path, ...]
    missing: dict[str, str] = field(default_factory=dict)


def is_recorded(source: Path, kinds: Sequence[str]) -> bool:
    """Return True if the source is a trace, a run or a submitted campaign."""
    # `scenario new patrol` makes a folder with the name of its campaign, which has traces as well.
    if source.suffix == ".mcap" or "traces" in kinds:
        return True
    return not source.exists() and source.suffix not in _FILE_ENDINGS and len(source.parts) == 1


def export_recorded(
    source: Path,
    kinds: Sequence[str],
    out: Path,
    target: DaemonTarget,
    part: tuple[float | None, float | None],
) -> ExportedFiles:
    """Write the traces of recorded runs into the folder ``out``, or the picture of one run.

    The picture shows the ``part`` of the run between two moments [s]. Raises wrong usage for other
    kinds, and for both at a time.
    """
    if len(kinds) != 1 or kinds[0] not in RECORDED_KINDS:
        other = [kind for kind in kinds if kind not in RECORDED_KINDS]
        message = "recorded runs have `picture` and `traces`, one at a time"
        if other and "traces" not in kinds:
            about = f"{other[0]} needs a building or a campaign file, and {source} is not a file"
            message = f"{about}: {message}"
        raise typer.BadParameter(message, param_hint="KIND")
    if kinds[0] == "traces":
        check_folder(out, "--out")
        return _copy_traces(str(source), out, target)
    from daemon.analysis.report.run_maps import draw_run

    path = out
    if out.is_dir() or not out.suffix:
        path = out / f"{source.name.removesuffix('.mcap')}.svg"
    if path.suffix not in _PICTURE_ENDINGS:
        raise typer.BadParameter(f"{path} must end in .svg, .png or .pdf", param_hint="--out")
    check_writable(path, "--out")
    trace = one_trace(str(source), target)
    with wrong_usage("--from, --until"):
        draw_run(trace, path, since=part[0], until=part[1])
    return ExportedFiles((path,))


def _copy_traces(name: str, folder: Path, target: DaemonTarget) -> ExportedFiles:
    """Copy the traces of a campaign or a run, from a daemon or their store.

    Each is verified. Interrupted copies are resumed, and complete ones are kept.
    """
    from daemon.batch.stores import copy_trace, trace_reference
    from daemon.model.ids import trace_name
    from daemon.model.verbs import DaemonClient

    if Path(name).is_file() and trace_files(name):
        raise typer.BadParameter(f"the trace {name} is already here", param_hint="SOURCE")
    # First all references, so that the progress bar knows the total size.
    traces: list[tuple[TraceReference, Path]] = []
    missing: dict[str, str] = {}
    files: list[Path] = []
    with target.read() as source:
        for row in recorded_runs(source, name, target):
            try:
                path = folder / trace_name(row.campaign, row.scenario, row.sut, row.repeat)
                traces.append((trace_reference(row), path))
            except TraceUnavailable as error:
                missing[row.id] = str(error)
        size = sum(trace.size for trace, _ in traces)
        daemon = source if isinstance(source, DaemonClient) else None
        with target.progress("fetching traces", size, "bytes") as advance:
            for trace, path in traces:
                try:
                    copy_trace(trace, daemon, path, progress=advance)
                    files.append(path)
                except TraceUnavailable as error:
                    missing[trace.run] = str(error)
    return ExportedFiles(tuple(files), missing)
