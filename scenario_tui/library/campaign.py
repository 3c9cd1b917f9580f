"""Campaigns: the runs of a file, its findings, its cells, their worlds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Self

from grammars.text.diagnostics import Finding, InputError, Severity, Where, did_you_mean
from grammars.text.words import count_noun
from scenario_tui.library.results import Results
from scenario_tui.source import DaemonTarget

if TYPE_CHECKING:
    from collections.abc import Iterable

    from daemon import campaign as loading
    from daemon.model.submission import Submission
    from scenario_tui.library.job import Job
    from templates.world import ArtefactWorld


def load(path: str | Path) -> Campaign:
    """Load a campaign file and every layer that it names.

    Raises :class:`InputError` with the findings if the file or a layer cannot be used.
    """
    from daemon.campaign import load_campaign

    return Campaign(Path(path), load_campaign(path))


def run(
    path: str | Path,
    *,
    workers: int | None = None,
    out: str | Path | None = None,
) -> Results:
    """Run a campaign file here and now: :func:`load`, then :meth:`Campaign.run`."""
    return load(path).run(workers=workers, out=out)


def submit(
    path: str | Path,
    *,
    connect: str = "",
    state: str | Path | None = None,
    fresh: bool = False,
) -> Job:
    """Submit a campaign file to a daemon: :func:`load`, then :meth:`Campaign.submit`."""
    return load(path).submit(connect=connect, state=state, fresh=fresh)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The world of a scenario as its first run begins: building, objects, mission, robot."""

    scenario: str
    _world: ArtefactWorld = field(repr=False)

    @property
    def spaces(self) -> tuple[str, ...]:
        """The names of rooms and other spaces."""
        return tuple(region.name for region in self._world.scene.regions)

    @property
    def objects(self) -> tuple[str, ...]:
        """The names of doors, furniture and people."""
        return tuple(one.name for one in self._world.scene.objects)

    def picture(self) -> str:
        """Return the world from above as the text of an SVG file."""
        from templates.picture import draw_world, picture_svg

        return picture_svg(draw_world(self._world))

    def _repr_svg_(self) -> str:
        return self.picture()


@dataclass(frozen=True, eq=False)
class Campaign:
    """A loaded campaign, or some of its cells; :func:`load` returns it.

    ``path`` is that of its file.
    """

    path: Path
    _loaded: loading.Campaign = field(repr=False)
    _selected: bool = False

    def __repr__(self) -> str:
        scenarios = count_noun(len(self.scenarios), "scenario")
        return f"Campaign({self.name!r}, {scenarios}, {count_noun(self.runs, 'run')})"

    @property
    def name(self) -> str:
        """The name that the file gives it."""
        return self._loaded.name

    @property
    def about(self) -> str:
        """The sentence of the file about it, empty without one."""
        return self._loaded.about

    @property
    def scenarios(self) -> tuple[str, ...]:
        """The names of its scenarios in the order of the file, one for each variant of a plan."""
        return tuple(cell.name for cell in self._loaded.cells)

    @property
    def systems(self) -> tuple[str, ...]:
        """The names of the systems under test, each once."""
        return tuple(dict.fromkeys(sut.name for cell in self._loaded.cells for sut in cell.suts))

    @property
    def runs(self) -> int:
        """The number of runs, without repeats that only come when a cell is not decided."""
        return self._loaded.runs

    @property
    def searches(self) -> tuple[str, ...]:
        """The names of the searches of the file, which :meth:`run` leaves out."""
        return tuple(task.name for task in self._loaded.searches)

    def check(self) -> list[Finding]:
        """Return the findings about its layers, worlds, runs and searches; ``[]`` is good.

        Nothing is run. A campaign can be run if none of :attr:`findings` is an error.
        """
        if not self.checked.searches:
            return list(self.findings)
        from daemon.search.preparation import check_searches

        return [*self.findings, *check_searches(self.checked)]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings about everything except its searches."""
        return self._examined[1]

    @property
    def checked(self) -> loading.Campaign:
        """The campaign as loaded, with the warnings that it allows."""
        return self._examined[0]

    @cached_property
    def _examined(self) -> tuple[loading.Campaign, tuple[Finding, ...]]:
        from daemon.campaign import check_campaign

        return check_campaign(self._loaded, selected=self._selected)

    def select(self, scenario: str = "", system: str = "") -> Self:
        """Return the campaign with the cells of one scenario, of one system, or both.

        Their runs are those of the whole campaign: same specifications, seeds and digests. A
        ``system`` that the campaign does not list takes the place of its systems: the path of a
        file, or a name as campaigns write it. Files stay as they are. Raises :class:`InputError`
        for other names.
        """
        loaded = self._loaded
        if system and system not in self.systems:
            from daemon.campaign import load_campaign

            file = Path(system)
            is_path = file.suffix in (".yaml", ".yml") and file.is_file()
            loaded = load_campaign(self.path, system=str(file.resolve()) if is_path else system)
            cells = tuple(cell for cell in loaded.cells if cell.name in self.scenarios)
            loaded = replace(loaded, cells=cells)
            system = ""
        cells = loaded.cells
        if scenario:
            cells = tuple(one for one in cells if scenario in (one.name, one.scenario.name))
            names = dict.fromkeys((*self.scenarios, *(c.scenario.name for c in loaded.cells)))
            self._refuse_empty(cells, f'no scenario "{scenario}"', scenario, names)
        if system:
            picked = ((one, tuple(s for s in one.suts if s.name == system)) for one in cells)
            names = dict.fromkeys(sut.name for cell in cells for sut in cell.suts)
            cells = tuple(replace(one, suts=suts) for one, suts in picked if suts)
            self._refuse_empty(cells, f'"{scenario}" is not run with "{system}"', system, names)
        scenarios = {cell.scenario.name for cell in cells}
        comparisons = tuple(
            one for one in loaded.declared.comparisons if {one.left, one.right} <= scenarios
        )
        declared = replace(loaded.declared, comparisons=comparisons)
        loaded = replace(loaded, cells=cells, declared=declared, searches=())
        return type(self)(self.path, loaded, _selected=True)

    def _refuse_empty(
        self, cells: tuple[object, ...], message: str, word: str, names: Iterable[str]
    ) -> None:
        if not cells:
            raise InputError.at(Where(str(self.path)), message, did_you_mean(word, names))

    def scene(self, scenario: str = "") -> Scene:
        """Return the world of a scenario, of the first one by default.

        Raises :class:`InputError` if that does not exist.
        """
        from daemon.analysis.campaign_worlds import world_of_cell

        cell = (self.select(scenario) if scenario else self)._loaded.cells[0]
        return Scene(cell.name, world_of_cell(self._loaded, cell, repeats=1))

    def submission(self, *, fresh: bool = False) -> Submission:
        """Return the submission of every run; with ``fresh`` a new id makes all run anew.

        Raises :class:`InputError` with all findings if one of them is an error.
        """
        from daemon.campaign import campaign_origin, expand

        if any(one.severity is Severity.ERROR for one in self.findings):
            raise InputError(self.findings)
        origin = campaign_origin(self._loaded, self.path)
        return replace(expand(self._loaded, fresh=fresh), origin=origin)

    def run(
        self,
        *,
        workers: int | None = None,
        out: str | Path | None = None,
        wall: float | None = None,
        attempts: int | None = None,
    ) -> Results:
        """Run it here and now, by a daemon that ends with the call, and return the results.

        At most ``workers`` runs go on at a time, one per core by default. Traces go to ``out``, by
        default ``scenario-results/<campaign>/``. A run that takes more than ``wall`` seconds ends
        as an error, by default ten times its simulated limit and at least 300 s. A run whose
        process dies is tried ``attempts`` times, by default 3.

        On a terminal and in a notebook a bar shows the progress. An interrupt ends the daemon and
        leaves finished traces alone; it raises ``KeyboardInterrupt``. Raises :class:`InputError`
        with all findings when one of them is an error and :class:`DaemonError` when runs cannot
        be executed.
        """
        from scenario_tui.library.execution import run_here

        folder = None if out is None else Path(out)
        submission = self.submission()
        value = run_here(submission, folder, workers, wall=wall, attempts=attempts)
        return Results(value, DaemonTarget())

    def submit(
        self,
        *,
        connect: str = "",
        state: str | Path | None = None,
        fresh: bool = False,
        workers: int | None = None,
    ) -> Job:
        """Submit it to a daemon and return at once; only runs without a result are executed.

        ``connect`` is the endpoint of the daemon (``tls/host:port``), ``state`` the state directory
        of one on this machine. Otherwise it is that of ``$SCENARIO_CONNECT``, then the daemon of
        this machine. If that does not answer, it is started with ``workers`` runs at a time.
        ``fresh`` runs everything anew. Raises :class:`InputError` with all findings when one of
        them is an error and :class:`DaemonError` when no daemon takes it.
        """
        from scenario_tui.library.job import submit_to

        target = DaemonTarget(connect, None if state is None else Path(state))
        return submit_to(target, self.submission(fresh=fresh), workers)

    def _repr_html_(self) -> str:
        from scenario_tui.library.notebook import campaign_html

        return campaign_html(self.checked)
