"""Results of a campaign: cells, runs and their verdicts, whoever recorded them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from daemon.batch.errors import TraceUnavailable
from grammars.text.diagnostics import did_you_mean
from scenario_tui.library.trace import Trace
from scenario_tui.source import DaemonTarget

if TYPE_CHECKING:
    import pandas
    import pyarrow

    from daemon.analysis.results import CampaignResults
    from daemon.model.assessments import CellAssessment
    from daemon.model.status import RunRow
    from daemon.model.verdicts import Outcome, Verdict


def results(name: str | Path, *, connect: str = "", state: str | Path | None = None) -> Results:
    """Return the results of a campaign by name or id, of a folder of traces, or of a file.

    A name is asked of the daemon at ``connect`` (``tls/host:port``), otherwise of the ledger in
    the directory ``state``, by default that of this machine. Without an id it is the newest of its
    name. A file is one that ``scenario results --json`` wrote. Raises :class:`DaemonError` when
    there is no such campaign and :class:`InputError` when a file cannot be used.
    """
    from daemon.analysis.results import read_results
    from scenario_tui.source import find_campaign, open_source

    target = DaemonTarget(connect, None if state is None else Path(state))
    with open_source(str(name), target) as source:
        return Results(read_results(source, find_campaign(source, str(name))), target)


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One run of a campaign."""

    _row: RunRow
    _target: DaemonTarget

    def __repr__(self) -> str:
        return f"Run({self.id!r}, {self._row.label}: {self.outcome or self._row.state})"

    @property
    def id(self) -> str:
        """The id that commands take, or the path of the trace where no daemon keeps the run."""
        return self._row.id

    @property
    def scenario(self) -> str:
        """The name of its scenario, with ``@SEED`` for a variant of a floor plan."""
        return self._row.scenario

    @property
    def system(self) -> str:
        """The name of its system under test."""
        return self._row.sut

    @property
    def repeat(self) -> int:
        """Its number in its cell, from 0."""
        return self._row.repeat

    @property
    def seed(self) -> int:
        """The seed of everything that was drawn in it."""
        return self._row.seed

    @property
    def outcome(self) -> Outcome | None:
        """The verdict of all its oracles together, ``None`` without a result."""
        return self._row.outcome

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """The verdicts of its oracles and measures, empty without a result."""
        return self._row.verdicts

    @property
    def note(self) -> str:
        """Everything else there is to say: why it was lost, what its system printed last."""
        return self._row.note

    @property
    def trace(self) -> Trace:
        """Its recording, brought to this machine first if it lies elsewhere.

        Raises :class:`DaemonError` when there is none (yet).
        """
        from scenario_tui.source import one_trace

        path = Path(self._row.trace) if self._row.trace else None
        if path is not None and path.is_file():
            return Trace(path)
        if self._row.result is None:
            raise TraceUnavailable(f"{self.id} has no trace: it was not executed (yet)")
        return Trace(one_trace(self.id, self._target))

    def picture(self) -> str:
        """Return the run from above as the text of an SVG file, with the place that decided.

        Raises as :attr:`trace` does.
        """
        return self.trace.picture()

    @property
    def replay_command(self) -> str:
        """The command line that replays it in a terminal."""
        return self._target.command("replay", self.id)

    def _repr_svg_(self) -> str:
        return self.picture()


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """A scenario with a system under test: all its repeats."""

    runs: tuple[Run, ...]
    _assessment: CellAssessment

    def __repr__(self) -> str:
        return f"Cell({self.scenario!r}, {self.system!r}, {self.outcome}, {len(self.runs)} runs)"

    @property
    def scenario(self) -> str:
        """The name of the scenario."""
        return self._assessment.scenario

    @property
    def system(self) -> str:
        """The name of the system under test."""
        return self._assessment.sut

    @property
    def outcome(self) -> Outcome:
        """The gravest verdict of its oracles over all repeats."""
        return self._assessment.verdict

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """The verdict of each oracle in its worst repeat, then measures in the first repeat."""
        worst = [one.worst.verdict for one in self._assessment.oracles if one.worst]
        verdicts = {verdict.oracle: verdict for verdict in worst}
        for run in self.runs:
            for verdict in run.verdicts:
                verdicts.setdefault(verdict.oracle, verdict)
        return tuple(verdicts.values())

    def __getitem__(self, oracle: str) -> Verdict:
        """Return the verdict of an oracle in its worst repeat; of a measure, in the first one.

        Raises ``KeyError`` for an oracle that judged no run of the cell.
        """
        __tracebackhide__ = True
        verdicts = {verdict.oracle: verdict for verdict in self.verdicts}
        if oracle not in verdicts:
            raise KeyError(f"no verdict of {oracle}: {did_you_mean(oracle, verdicts)}")
        return verdicts[oracle]


@dataclass(frozen=True, eq=False)
class Results:
    """Results of a campaign, as they stood when they were read."""

    value: CampaignResults
    """The value that ``scenario results --json`` writes; its fields may change."""
    _target: DaemonTarget

    def __repr__(self) -> str:
        return f"Results({self.id!r}, {len(self.runs)} runs, passed={self.passed})"

    @property
    def id(self) -> str:
        """The id of the campaign; the folder or file where no daemon knows it."""
        return self.value.row.id

    @property
    def name(self) -> str:
        """The name that the campaign file gives it."""
        return self.value.row.name

    @property
    def finished(self) -> bool:
        """True when no run waits or is running."""
        return self.value.row.finished

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """All runs in order, also those without a result."""
        return tuple(Run(row, self._target) for row in self.value.rows)

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """The cells in the order of the runs."""
        runs = {run.id: run for run in self.runs}
        cells = self.value.assessment.cells
        return tuple(Cell(tuple(runs[one] for one in cell.runs), cell) for cell in cells)

    def __getitem__(self, cell: tuple[str, str]) -> Cell:
        """Return the cell of a scenario and a system: ``results["busy-house", "pilot"]``.

        Raises ``KeyError`` when there is none.
        """
        __tracebackhide__ = True
        cells = {(one.scenario, one.system): one for one in self.cells}
        if cell not in cells:
            words = [", ".join(names) for names in cells]
            wrong = ", ".join(map(str, cell)) if isinstance(cell, tuple) else str(cell)
            raise KeyError(f"no cell {wrong}: {did_you_mean(wrong, words)}")
        return cells[cell]

    @property
    def passed(self) -> bool:
        """True when everything was judged and is as the campaign expects."""
        return self.value.assessment.exit_code == 0

    @property
    def unexpected(self) -> tuple[str, ...]:
        """A sentence for everything that is not as expected, undecided or not executed."""
        from scenario_tui.text.assessment_text import attention_lists
        from scenario_tui.text.run_state import unfinished_text

        lists = attention_lists(self.value)
        lines = (line.plain.strip() for _, lines in lists for line in lines)
        return tuple(filter(None, (*lines, unfinished_text(self.value.row))))

    def to_arrow(self) -> pyarrow.Table:
        """Return a table with one row for each run and oracle."""
        from daemon.analysis.table import results_table

        return results_table(self.value)

    def to_pandas(self) -> pandas.DataFrame:
        """Return :meth:`to_arrow` as a data frame; pandas must be installed."""
        return self.to_arrow().to_pandas()

    def __arrow_c_stream__(self, requested_schema: object = None) -> Any:
        """Hand the table to polars, DuckDB or pandas (Arrow's PyCapsule interface)."""
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def _repr_html_(self) -> str:
        from scenario_tui.library.notebook import results_html

        return results_html(self.value)
