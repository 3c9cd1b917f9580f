"""Pytest plug-in: campaigns as tests, and the runs that tests ask for.

A campaign file becomes one item for each scenario, system and oracle, and one for each comparison.
Its runs begin with the first of these items. They are executed by a private daemon, which all
processes of pytest-xdist share and which keeps results by digest in pytest's cache.
"""

from __future__ import annotations

import os
import shlex
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeAlias

import pytest

from daemon.batch.client import Client
from daemon.batch.errors import TraceUnavailable
from daemon.batch.launch import shared_daemon
from daemon.batch.stores import trace_file
from daemon.campaign import campaign_origin, expand
from daemon.judging.assessment import assess, base_name, expected_verdict
from daemon.model.assessments import CellVerdict, ComparisonVerdict, ExpectationStatus
from daemon.model.run_state import RunState
from daemon.model.status import CampaignRow, RunRow
from daemon.model.verbs import DaemonClient
from daemon.model.verdicts import Outcome
from grammars.text.diagnostics import InputError, ScenarioError, Severity
from scenario_tui.library.campaign import Campaign, load
from scenario_tui.library.watching import ProgressDisplay, WatchedRuns, watch_work
from scenario_tui.text.assessment_text import Footnotes, comparison_notes, oracle_notes

if TYPE_CHECKING:
    from daemon import campaign as loading

CellName: TypeAlias = tuple[str, str]
"""A scenario, or one of its variants, and a system."""

_KEPT: Final = 2**30
"""Bytes of traces that pytest's cache keeps of earlier sessions."""
_PICTURES_KEPT: Final = 86_400.0
"""Seconds for which it keeps pictures of failed runs."""
_ENDURANCE: Final = 20.0
"""Seconds without a worker, or with a full disk, after which nobody is going to help."""


class KnownFailureError(Exception):
    """A failure that the campaign expects: the only one that its ``xfail`` mark covers."""


class ScenarioPlugin:
    """Part of the plug-in that lives as long as one process of pytest; it holds the daemon."""

    _NAME: ClassVar = "scenario-runs"

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._resources = ExitStack()
        config.add_cleanup(self._resources.close)

    @classmethod
    def of(cls, config: pytest.Config) -> ScenarioPlugin:
        """Return the plug-in of this process, which is registered when it is first needed."""
        plugin = config.pluginmanager.get_plugin(cls._NAME)
        if plugin is None:
            plugin = cls(config)
            config.pluginmanager.register(plugin, cls._NAME)
        assert isinstance(plugin, cls)
        return plugin

    def campaign_file(self, path: Path, parent: pytest.Collector) -> CampaignCollector:
        """Return the node of a campaign file."""
        return CampaignCollector.from_parent(parent, path=path)

    @cached_property
    def connected(self) -> str:
        """Endpoint of the daemon that people named, empty for the private one."""
        named = self._config.getoption("--scenario-connect")
        return str(named or os.environ.get("SCENARIO_CONNECT", ""))

    @cached_property
    def endpoint(self) -> str:
        """Endpoint of the daemon; the private one is started, or joined, for the first reader."""
        if self.connected:
            return self.connected
        return self._resources.enter_context(shared_daemon(self.folder, kept=_KEPT))

    @cached_property
    def folder(self) -> Path:
        """Private state directory; pictures of failed runs lie there, too."""
        if getattr(self._config, "cache", None) is not None:
            return Path(self._config.cache.mkdir("scenario"))
        # Without a cache: with the temporary files that pytest keeps of its last sessions. Those of
        # processes of pytest-xdist lie below one folder.
        base = self._config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]
        return Path(base.parent if hasattr(self._config, "workerinput") else base) / "scenario"

    def open(self) -> AbstractContextManager[DaemonClient]:
        """Open a connection to the daemon."""
        return Client.open(self.endpoint)

    @contextmanager
    def progress(self) -> Iterator[None]:
        """Show progress on a terminal, below the line that pytest writes, and remove it again."""
        reporter = self._config.pluginmanager.get_plugin("terminalreporter")
        capture = self._config.pluginmanager.get_plugin("capturemanager")
        if not (reporter and capture and reporter.isatty and reporter.verbosity >= 0):
            yield
            return
        writer = self._config.get_terminal_writer()
        writer.flush()
        with capture.global_and_fixture_disabled():
            if sys.stderr.isatty():
                sys.stderr.write("\n")
            yield
            if sys.stderr.isatty():
                sys.stderr.write(f"\x1b[A\r\x1b[{writer.width_of_current_line}C")

    def evidence(self, run: RunRow) -> str:
        """Return where to look at a run: its picture, and the command that replays it."""
        command = ["scenario", "replay", run.id, "--connect", self.connected]
        try:
            with self.open() as daemon:
                trace = trace_file(run, daemon if self.connected else None)
            if not self.connected:
                command[2:] = [_typed(trace)]
            picture = self.folder / "pictures" / f"{run.id}.svg"
            _draw(trace, picture)
        except (TraceUnavailable, OSError) as error:
            return f"no trace to look at: {error} (pytest --cache-clear runs it anew)"
        return f"picture: {_typed(picture)}\nreplay:  {shlex.join(command)}"


def _draw(trace: Path, picture: Path) -> None:
    from daemon.analysis.report.run_maps import draw_run

    picture.parent.mkdir(exist_ok=True)
    for earlier in picture.parent.glob("*.svg"):
        with suppress(FileNotFoundError):  # another process removes it
            if time.time() - earlier.stat().st_mtime > _PICTURES_KEPT:
                earlier.unlink()
    draw_run(trace, picture)


def _typed(path: Path) -> str:
    """Return a path as it can be typed in the folder that pytest was started in."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


@dataclass
class WatchedCells(WatchedRuns):
    """The runs of a campaign, until those of ``cells`` have ended.

    With ``whole`` they end with the campaign: an undecided cell may get more of them.
    """

    whole: bool = False
    cells: frozenset[CellName] = frozenset()
    rows: tuple[RunRow, ...] = ()

    def look(self, daemon: DaemonClient, shown: ProgressDisplay) -> CampaignRow:
        """Return how the campaign stands, after asking for the runs that may have changed."""
        row = super().look(daemon, shown)
        settled = next((i for i, run in enumerate(self.rows) if not run.settled), len(self.rows))
        newer = daemon.all_runs(self.campaign, offset=settled, results=True)
        self.rows = (*self.rows[:settled], *newer)
        return row

    @property
    def finished(self) -> bool:
        """Whether no more runs of the cells will come."""
        if super().finished or self.whole or self.row is None:
            return super().finished
        return all(run.settled for run in self.of_cells)

    @property
    def of_cells(self) -> tuple[RunRow, ...]:
        """The runs of the cells."""
        return tuple(run for run in self.rows if (run.scenario, run.sut) in self.cells)


@dataclass
class CampaignRuns:
    """The runs of a campaign file that the items of this process need."""

    plugin: ScenarioPlugin
    path: Path
    campaign: loading.Campaign
    _watched: WatchedCells | None = None

    def submit(self, cells: Iterable[CellName]) -> None:
        """Hand the runs of ``cells`` to the daemon, unless that is done."""
        if self._watched is not None:
            return
        submission = expand(_only(self.campaign, frozenset(cells)))
        origin = campaign_origin(self.campaign, self.path)
        with self.plugin.open() as daemon:
            receipt = daemon.submit(replace(submission, origin=origin))
            if receipt.known:  # a session that was interrupted may have left it
                daemon.retry(receipt.campaign)
        policy = self.campaign.declared.policy
        self._watched = WatchedCells(receipt.campaign, whole=policy.until_decided)

    def results(self, cells: frozenset[CellName]) -> tuple[RunRow, ...]:
        """Return the runs of ``cells`` after they have ended; :meth:`submit` comes first."""
        watched = self._watched
        assert watched is not None
        watched.cells = cells
        if not watched.finished:
            with self.plugin.progress():
                watch_work(self.plugin.open, watched.campaign, watched, endurance=_ENDURANCE)
        return watched.of_cells


def _refuse_errors(campaign: Campaign) -> None:
    """Raise :class:`InputError` with the findings of a campaign that cannot be run."""
    errors = [one for one in campaign.findings if one.severity is Severity.ERROR]
    if errors:
        raise InputError(errors)


def _only(campaign: loading.Campaign, cells: frozenset[CellName]) -> loading.Campaign:
    """Return the campaign with these cells alone."""
    kept = (
        replace(cell, suts=tuple(sut for sut in cell.suts if (cell.name, sut.name) in cells))
        for cell in campaign.cells
    )
    return replace(campaign, cells=tuple(cell for cell in kept if cell.suts))


class CampaignCollector(pytest.File):
    """A campaign file: a collector for each scenario, and one for its comparisons."""

    runs: CampaignRuns

    def collect(self) -> Iterator[pytest.Collector]:
        """Yield the scenarios; raises ``CollectError`` with what is wrong with the campaign."""
        try:
            campaign = load(_typed(self.path))
            _refuse_errors(campaign)
        except ScenarioError as error:
            raise self.CollectError(str(error)) from error
        self.runs = CampaignRuns(ScenarioPlugin.of(self.config), self.path, campaign.checked)
        for cell in campaign.checked.cells:
            names = [oracle.name for oracle in cell.oracles if not oracle.is_measure]
            items = [
                ((cell.name, sut.name), name, frozenset([(cell.name, sut.name)]))
                for sut in cell.suts
                for name in names
            ]
            yield ScenarioCollector.from_parent(self, name=cell.name, members=_by_system(items))
        if compared := list(_compared(campaign.checked)):
            yield ScenarioCollector.from_parent(self, name="compare", members=_by_system(compared))

    def submit(self) -> None:
        """Hand over the runs of the items that this session has of every campaign."""
        needed: dict[CampaignCollector, set[CellName]] = {}
        for item in self.session.items:
            if isinstance(item, CampaignItem):
                needed.setdefault(item.file, set()).update(item.cells)
        for file, cells in needed.items():
            file.runs.submit(cells)


Member: TypeAlias = tuple[CellName, str, frozenset[CellName]]
"""An item: scenario and system, oracle or comparison, and the cells whose runs decide it."""


def _words(verdict: CellVerdict | ComparisonVerdict) -> str:
    """Return a verdict over all repeats as the dashboard says it."""
    if isinstance(verdict, CellVerdict):
        return oracle_notes(verdict).plain.strip()
    return comparison_notes(verdict, Footnotes()).plain.strip()


def _by_system(items: Sequence[Member]) -> dict[str, list[Member]]:
    members: dict[str, list[Member]] = {}
    for item in items:
        members.setdefault(item[0][1], []).append(item)
    return members


def _compared(campaign: loading.Campaign) -> Iterator[Member]:
    """Yield each comparison with every system that runs both of its scenarios."""
    systems = dict.fromkeys(sut.name for cell in campaign.cells for sut in cell.suts)
    for comparison in campaign.declared.comparisons:
        sides = {comparison.left, comparison.right}
        for system in systems:
            cells = frozenset(
                (cell.name, system)
                for cell in campaign.cells
                if base_name(cell.name) in sides and system in {sut.name for sut in cell.suts}
            )
            if {base_name(scenario) for scenario, _ in cells} == sides:
                yield (comparison.left, system), comparison.name, cells


class ScenarioCollector(pytest.Collector):
    """A scenario, or the comparisons: a collector for each system."""

    def __init__(self, *, members: dict[str, list[Member]], **more: Any) -> None:
        super().__init__(**more)
        self._members = members

    def collect(self) -> Iterator[pytest.Collector]:
        """Yield the systems."""
        for system, members in self._members.items():
            yield SystemCollector.from_parent(self, name=system, members=members)


class SystemCollector(pytest.Collector):
    """A scenario with a system: an item for each oracle."""

    def __init__(self, *, members: list[Member], **more: Any) -> None:
        super().__init__(**more)
        self._members = members

    def collect(self) -> Iterator[pytest.Item]:
        """Yield the oracles."""
        for member in self._members:
            yield CampaignItem.from_parent(self, name=member[1], member=member)


class CampaignItem(pytest.Item):
    """An oracle over all repeats of a scenario with a system, or a comparison of scenarios."""

    def __init__(self, *, member: Member, **more: Any) -> None:
        super().__init__(**more)
        file = self.getparent(CampaignCollector)
        assert file is not None
        self.file = file
        (self._scenario, self._system), _, self.cells = member
        declared = file.runs.campaign.declared
        expected, why = expected_verdict(
            declared.expectations, self._scenario, self.name, self._system
        )
        if expected != "pass":
            # Nobody is to be red for what may come out either way.
            strict = expected != "any"
            self.add_marker(pytest.mark.xfail(raises=KnownFailureError, strict=strict, reason=why))
        self._found: CellVerdict | ComparisonVerdict | None = None
        self._runs: tuple[RunRow, ...] = ()

    def setup(self) -> None:
        """Execute the runs, which is an error where too few of them have a result."""
        try:
            self.file.submit()
            self._runs = self.file.runs.results(self.cells)
        except ScenarioError as error:
            pytest.fail(str(error), pytrace=False)
        assessment = assess(self.file.runs.campaign.declared, self._runs)
        verdicts: dict[str, CellVerdict | ComparisonVerdict] = {
            **{one.oracle: one for cell in assessment.cells for one in cell.oracles},
            **{one.comparison: one for one in assessment.comparisons},
        }
        self._found = verdicts.get(self.name)
        lost = [row for row in self._runs if row.state in (RunState.LOST, RunState.CANCELLED)]
        undecided = self._found is None or self._found.verdict is Outcome.INCONCLUSIVE
        if lost and undecided:
            lines = [f"{row.label} was {row.state}: {row.reason}" for row in lost]
            pytest.fail("\n".join(lines), pytrace=False)
        self._add_properties()

    def _add_properties(self) -> None:
        """Record the decisive run for ``--junit-xml``."""
        run = self._decisive_run
        if run is None or not isinstance(self._found, CellVerdict) or self._found.worst is None:
            return
        verdict = self._found.worst.verdict
        self.user_properties += [
            ("margin", verdict.margin),
            ("unit", verdict.unit),
            ("seed", run.seed),
            ("digest", run.digest),
            ("trace", run.trace),
        ]

    @property
    def _decisive_run(self) -> RunRow | None:
        worst = self._found.worst if isinstance(self._found, CellVerdict) else None
        return next((run for run in self._runs if worst and run.id == worst.run), None)

    def runtest(self) -> None:
        """Raise unless the verdict is as expected."""
        found, run = self._found, self._decisive_run
        assert found is not None
        passes = found.verdict is Outcome.PASS
        words = _words(found)
        if found.status is ExpectationStatus.MET:
            if found.expected == "pass" or (found.expected == "any" and passes):
                return
            raise KnownFailureError(words)
        if found.expected != "pass" and passes:
            return  # which the strict mark makes a failure
        evidence = self.file.runs.plugin.evidence(run) if run else ""
        pytest.fail(f"{words}\n{evidence}".strip(), pytrace=False)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return a known failure in words, which ``--runxfail`` shows."""
        if isinstance(excinfo.value, KnownFailureError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return file and heading of the report."""
        return self.path, None, f"{self._scenario} / {self._system} / {self.name}"
