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
from collections.abc import Generator, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeAlias

import pytest

from daemon.analysis.results import read_results
from daemon.batch.launch import shared_daemon
from daemon.batch.paths import is_endpoint, parse_endpoint
from daemon.campaign import campaign_origin, expand
from daemon.judging.assessment import (
    assess,
    base_name,
    expected_verdict,
    find_marks,
)
from daemon.model.assessments import (
    NO_MARK,
    CellVerdict,
    ComparisonVerdict,
    ExpectationStatus,
    Mark,
)
from daemon.model.status import RunRow
from daemon.model.verdicts import Outcome, RunState
from grammars.text.diagnostics import InputError, ScenarioError, Severity, Where, raise_all
from scenario_tui.campaign_files import relative_name
from scenario_tui.library.campaign import load
from scenario_tui.library.results import Cell, Results, Run
from scenario_tui.library.watching import ENDURANCE, PATIENCE, CollectedRuns, watch
from scenario_tui.source import DaemonTarget
from scenario_tui.text.assessment_text import comparison_notes, oracle_notes
from scenario_tui.text.formatting import glyph_word
from scenario_tui.text.run_text import by_severity, evidence_parts

if TYPE_CHECKING:
    from daemon import campaign as loading

CellName: TypeAlias = tuple[str, str]
"""A scenario, or one of its variants, and a system."""

_TRACE_BYTES: Final = 2**30
"""Bytes of traces that pytest's cache keeps of earlier sessions."""
_PICTURES_KEPT: Final = 86_400.0
"""Seconds for which it keeps pictures of failed runs."""
_CELLS: Final = pytest.StashKey[list[Cell]]()
"""The cells that a test asked for."""


class KnownFailureError(pytest.fail.Exception):  # type: ignore[name-defined, misc]
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

    @cached_property
    def target(self) -> DaemonTarget:
        """The daemon that people named, otherwise the private one, started or joined here."""
        named = parse_endpoint(self._config.getoption("--scenario-connect"))
        if named and not is_endpoint(named):
            hint = "write tcp/<host>:<port>, tls/<host>:<port> or the path of a socket"
            raise InputError.at(Where("--scenario-connect"), f"{named!r} is not an endpoint", hint)
        if named or os.environ.get("SCENARIO_CONNECT"):
            return DaemonTarget(named)
        self._resources.enter_context(shared_daemon(self.folder, trace_bytes=_TRACE_BYTES))
        return DaemonTarget(state=self.folder)

    @cached_property
    def folder(self) -> Path:
        """Private state directory; pictures of failed runs lie there, too."""
        if getattr(self._config, "cache", None) is not None:
            return Path(self._config.cache.mkdir("scenario"))
        # Without a cache it lies with pytest's temporary files. Processes of pytest-xdist have
        # theirs below one folder.
        base = self._config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]
        return Path(base.parent if hasattr(self._config, "workerinput") else base) / "scenario"

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

    def evidence(self, run: Run) -> str:
        """Return where to look at a run: its picture, and the command that replays it."""
        picture = self.folder / "pictures" / f"{run.id}.svg"
        try:
            trace = run.trace.path
            _write_picture(run.picture(), picture)
        except (ScenarioError, OSError) as error:
            return f"no trace to look at: {error} (pytest --cache-clear runs it anew)"
        # The daemon has ended when people type this.
        local = shlex.join(("scenario", "replay", relative_name(trace, Path.cwd())))
        command = run.replay_command if self.target.named else local
        return f"picture: {relative_name(picture, Path.cwd())}\nreplay:  {command}"

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Add a section to the report of a failed test for each cell that it asked for."""
        report = yield
        if call.when != "teardown" and report.failed:
            for cell in item.stash.get(_CELLS, ()):
                title = f"{cell.scenario} / {cell.system}"
                report.sections.append((title, self._cell_words(cell)))
        return report

    def _cell_words(self, cell: Cell) -> str:
        judged = by_severity(one for one in cell.verdicts if one.outcome is not Outcome.MEASURE)
        # If all pass, the test itself is stricter than the oracles.
        listed = [one for one in judged if one.outcome is not Outcome.PASS] or judged
        lines = [
            f"{glyph_word(one.outcome)}  {one.oracle}  {', '.join(evidence_parts(one))}"
            for one in listed
        ]
        runs = (run for run in cell.runs for one in listed if one in run.verdicts)
        return "\n".join([*lines, self.evidence(next(runs, cell.runs[0]))])


@dataclass(frozen=True, slots=True)
class ScenarioRunner:
    """The value of the fixture ``scenario`` of one test."""

    plugin: ScenarioPlugin = field(repr=False)
    item: pytest.Item = field(repr=False)

    def __call__(self, campaign: str | Path, scenario: str, sut: str = "") -> Cell:
        """Return the cell of a scenario of a campaign file with a system, after its runs.

        ``sut`` is a system of the campaign, another one by its name or file, or left out where the
        campaign has one. Files are relative to the root directory of pytest. The test fails with
        the findings when something is wrong with them, and when a run leaves no result.
        """
        __tracebackhide__ = True
        root = self.item.config.rootpath
        file = root / sut
        with _plain_failures():
            loaded = _load(root / campaign, scenario, str(file) if file.is_file() else sut)
            cells = {(one.name, system.name) for one in loaded.cells for system in one.suts}
            if len(cells) > 1:
                names = ", ".join(f"{name} with {system}" for name, system in sorted(cells))
                pytest.fail(f"{campaign}: name one of {names}", pytrace=False)
            runs = CampaignRuns(self.plugin, root / campaign, loaded)
            runs.submit(cells)
            if message := _lost(runs.rows(frozenset(cells))):
                pytest.fail(message, pytrace=False)
            (cell,) = runs.results().cells
        self.item.stash.setdefault(_CELLS, []).append(cell)
        return cell


def _lost(runs: Iterable[RunRow]) -> str:
    """Return which runs have no result and why, empty when all have one."""
    states = (RunState.LOST, RunState.CANCELLED)
    return "\n".join(
        f"{run.label} was {run.state}: {run.reason}" for run in runs if run.state in states
    )


def _write_picture(picture: str, path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    for earlier in path.parent.glob("*.svg"):
        with suppress(FileNotFoundError):  # another process removes it
            if time.time() - earlier.stat().st_mtime > _PICTURES_KEPT:
                earlier.unlink()
    path.write_text(picture, "utf-8")


@dataclass
class WatchedCells(CollectedRuns):
    """The runs of a campaign, until those of ``cells`` have ended.

    With ``whole`` they end with the campaign: an undecided cell may get more of them.
    """

    whole: bool = False
    cells: frozenset[CellName] = frozenset()

    @property
    def finished(self) -> bool:
        """True when no more runs of the cells will come."""
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
        with self.plugin.target.open() as daemon:
            receipt = daemon.submit(replace(submission, origin=origin))
            if receipt.known:  # an interrupted session may have left it
                daemon.retry(receipt.campaign)
        policy = self.campaign.declared.policy
        self._watched = WatchedCells(receipt.campaign, whole=policy.until_decided)

    def rows(self, cells: frozenset[CellName]) -> tuple[RunRow, ...]:
        """Return the runs of ``cells`` after they have ended; :meth:`submit` comes first."""
        watched = self._watched
        assert watched is not None
        watched.cells = cells
        if not watched.finished:
            with self.plugin.progress():
                target = self.plugin.target
                # A private daemon that is gone does not come back.
                patience = PATIENCE if target.named else 0.0
                watch(target.open, watched, patience=patience, endurance=ENDURANCE)
        return watched.of_cells

    def results(self) -> Results:
        """Return the results of all that was submitted, as they stand."""
        assert self._watched is not None
        assert self._watched.row is not None
        with self.plugin.target.open() as daemon:
            return Results(read_results(daemon, self._watched.row), self.plugin.target)


def _load(path: Path, scenario: str = "", sut: str = "") -> loading.Campaign:
    """Return a campaign, or one scenario of it; raises ``InputError`` if it cannot be run."""
    campaign = load(relative_name(path, Path.cwd()))
    if scenario:
        campaign = campaign.select(scenario, sut)
    raise_all(one for one in campaign.findings if one.severity is Severity.ERROR)
    return campaign.checked


@contextmanager
def _plain_failures() -> Iterator[None]:
    """Turn errors that people can mend into failures without a traceback."""
    try:
        yield
    except ScenarioError as error:
        raise pytest.fail.Exception(str(error), pytrace=False) from None


def _only(campaign: loading.Campaign, cells: frozenset[CellName]) -> loading.Campaign:
    """Return the campaign with these cells alone."""
    cells_alone = (
        replace(cell, suts=tuple(sut for sut in cell.suts if (cell.name, sut.name) in cells))
        for cell in campaign.cells
    )
    return replace(campaign, cells=tuple(cell for cell in cells_alone if cell.suts))


@dataclass(frozen=True, slots=True)
class Judged:
    """Subject of an item: a scenario with a system, judged by the runs of ``cells``."""

    scenario: str
    system: str
    cells: frozenset[CellName]


def _compared(campaign: loading.Campaign) -> Iterator[tuple[str, Judged]]:
    """Yield each comparison with every system that runs both of its scenarios."""
    cells = [(cell.name, sut.name) for cell in campaign.cells for sut in cell.suts]
    for comparison in campaign.declared.comparisons:
        sides = {comparison.left, comparison.right}
        for system in dict.fromkeys(system for _, system in cells):
            own = frozenset(one for one in cells if base_name(one[0]) in sides and one[1] == system)
            if {base_name(scenario) for scenario, _ in own} == sides:
                yield comparison.name, Judged(comparison.left, system, own)


class CampaignCollector(pytest.File):
    """A campaign file: a collector for each scenario, and one for its comparisons."""

    runs: CampaignRuns

    def collect(self) -> Iterator[pytest.Collector]:
        """Yield the scenarios; raises ``CollectError`` with the findings about the campaign."""
        try:
            campaign = _load(self.path)
        except ScenarioError as error:
            raise self.CollectError(str(error)) from error
        self.runs = CampaignRuns(ScenarioPlugin.of(self.config), self.path, campaign)
        items = [
            (
                cell.name,
                oracle.name,
                Judged(cell.name, sut.name, frozenset([(cell.name, sut.name)])),
            )
            for cell in campaign.cells
            for sut in cell.suts
            for oracle in cell.oracles
            if not oracle.is_measure
        ]
        items += [("compare", name, judged) for name, judged in _compared(campaign)]
        parts: dict[str, Any] = {}
        for scenario, name, judged in items:
            parts.setdefault(scenario, {}).setdefault(judged.system, {})[name] = judged
        for name, part in parts.items():
            yield CampaignPart.from_parent(self, name=name, part=part)

    def submit(self) -> None:
        """Hand over the runs of all items of this session, of every campaign."""
        needed: dict[CampaignCollector, set[CellName]] = {}
        for item in self.session.items:
            if isinstance(item, CampaignItem):
                needed.setdefault(item.file, set()).update(item.judged.cells)
        for file, cells in needed.items():
            file.runs.submit(cells)


class CampaignPart(pytest.Collector):
    """A scenario with its systems, or a scenario with a system and its oracles."""

    def __init__(self, *, part: dict[str, Any], **more: Any) -> None:
        super().__init__(**more)
        self._part = part

    def collect(self) -> Iterator[pytest.Item | pytest.Collector]:
        """Yield the systems, or the oracles."""
        for name, part in self._part.items():
            if isinstance(part, Judged):
                yield CampaignItem.from_parent(self, name=name, judged=part)
            else:
                yield CampaignPart.from_parent(self, name=name, part=part)


def _words(verdict: CellVerdict | ComparisonVerdict, mark: Mark) -> str:
    """Return a verdict over all repeats as the dashboard says it."""
    if isinstance(verdict, CellVerdict):
        return oracle_notes(verdict, mark).plain.strip()
    return comparison_notes(verdict, mark).plain.strip()


class CampaignItem(pytest.Item):
    """An oracle over all repeats of a scenario with a system, or a comparison of scenarios."""

    def __init__(self, *, judged: Judged, **more: Any) -> None:
        super().__init__(**more)
        file = self.getparent(CampaignCollector)
        assert file is not None
        self.file, self.judged = file, judged
        rules = file.runs.campaign.declared.expectations
        expected, why = expected_verdict(rules, judged.scenario, self.name, judged.system)
        if expected != "pass":
            # A verdict that may be either way never fails.
            strict = expected != "any"
            self.add_marker(pytest.mark.xfail(raises=KnownFailureError, strict=strict, reason=why))
        self._verdict: CellVerdict | ComparisonVerdict | None = None
        self._mark: Mark = NO_MARK
        self._worst: RunRow | None = None

    def setup(self) -> None:
        """Execute the runs, which is an error where too few of them have a result."""
        with _plain_failures():
            self.file.submit()
            runs = self.file.runs.rows(self.judged.cells)
        declared = self.file.runs.campaign.declared
        assessment = assess(declared, runs)
        verdicts: dict[str, CellVerdict | ComparisonVerdict] = {
            **{one.oracle: one for cell in assessment.cells for one in cell.oracles},
            **{one.comparison: one for one in assessment.comparisons},
        }
        self._verdict = verdict = verdicts.get(self.name)
        undecided = verdict is None or verdict.verdict is Outcome.INCONCLUSIVE
        if undecided and (message := _lost(runs)):
            pytest.fail(message, pytrace=False)
        if verdict is not None:
            self._mark = find_marks(declared, assessment, runs).mark_verdict(verdict)
        if isinstance(verdict, CellVerdict) and verdict.worst is not None:
            worst = verdict.worst
            run = self._worst = next(run for run in runs if run.id == worst.run)
            self.user_properties += [
                ("margin", worst.verdict.margin),
                ("unit", worst.verdict.unit),
                ("seed", run.seed),
                ("digest", run.digest),
                ("trace", run.trace),
            ]

    def runtest(self) -> None:
        """Raise unless the verdict is as expected."""
        verdict = self._verdict
        assert verdict is not None
        passes, expected = verdict.verdict is Outcome.PASS, verdict.expected
        if verdict.status is ExpectationStatus.MET:
            if expected == "pass" or (expected == "any" and passes):
                return
            raise KnownFailureError(_words(verdict, self._mark), pytrace=False)
        if expected != "pass" and passes:
            return  # the strict mark makes this a failure
        words, plugin = _words(verdict, self._mark), self.file.runs.plugin
        if self._worst is not None:
            words += f"\n{plugin.evidence(Run(self._worst, plugin.target))}"
        pytest.fail(words, pytrace=False)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return file and heading of the report."""
        return self.path, None, f"{self.judged.scenario} / {self.judged.system} / {self.name}"
