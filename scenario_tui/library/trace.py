"""Recorded runs: their signals, oracles written afterwards, their picture."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from grammars.text.diagnostics import InputError, Where, raise_all

if TYPE_CHECKING:
    from daemon.judging.oracles import SignalSampler
    from daemon.model.verdicts import Verdict
    from daemon.trace import Trace as RecordedTrace
    from grammars import oracle as language
    from scenario_tui.library.signal import Signal


class Trace:
    """A recorded run, an MCAP file at ``path``, which is read when it is first needed.

    A file that was cut off is read as far as it goes: oracles that need the rest are inconclusive.
    Every method raises :class:`InputError` when the file is no trace, or one whose signals leap and
    are not to be trusted.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    def __repr__(self) -> str:
        return f"Trace({str(self.path)!r})"

    @cached_property
    def recorded(self) -> RecordedTrace:
        """Everything in the file, as the simulator recorded it."""
        from daemon.trace import read_trace

        return read_trace(self.path)

    @cached_property
    def _sampler(self) -> SignalSampler:
        from daemon.judging.oracles import SignalSampler, trace_problems
        from daemon.trace import TraceError

        if problems := trace_problems(self.recorded):
            message = f"not to be trusted: {'; '.join(problems)}"
            raise TraceError(self.path, message, "run it again")
        return SignalSampler(self.recorded)

    @cached_property
    def _compared(self) -> tuple[language.ComparedLimit, ...]:
        """The limits in the oracles of its campaign, of those that can be read."""
        from daemon.judging.oracles import written_oracle
        from grammars.oracle import compared_limits

        oracles = map(written_oracle, self.recorded.spec.oracles)
        return tuple(limit for one in oracles if one for limit in compared_limits(one))

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """The verdicts of the oracles of its campaign, judged now."""
        from daemon.judging.oracles import judge

        return judge(self.recorded, self.recorded.spec.oracles, sampler=self._sampler)

    def signal(self, name: str) -> Signal:
        """Return a signal as oracles name it: ``clearance``, ``loc.error``, ``door_17.angle``, ….

        Raises :class:`InputError` for a name that is no signal of this run.
        """
        from daemon.judging.live import limits_of
        from grammars.oracle import kind_of
        from scenario_tui.library.signal import Signal

        oracle, signal = _parse_signal(name)
        self._refuse_unknown(oracle)
        kind = kind_of(signal)
        values = self._sampler.sample(signal).values
        unit = "bool" if kind is None else kind.unit
        limits = limits_of(name, self._compared)
        return Signal(name, unit, self._sampler.time_base.time, values, values, limits)

    def judge(self, text: str) -> Verdict:
        """Return the verdict of an oracle on this run: ``always(clearance >= 0.1 m)``.

        Raises :class:`InputError` with a place in the text for one that cannot be read or speaks
        of something that this run does not have.
        """
        from daemon.judging.oracles import judge
        from daemon.model.spec import OracleText
        from grammars.oracle import parse_oracle

        self._refuse_unknown(parse_oracle("oracle", text, Where("oracle", 1, 1)))
        (verdict,) = judge(self.recorded, (OracleText("oracle", text),), sampler=self._sampler)
        return verdict

    def _refuse_unknown(self, oracle: language.Oracle) -> None:
        from grammars.oracle import check_references

        raise_all(check_references(oracle, self.recorded.scene, self.recorded.spec.mission))

    def picture(self) -> str:
        """Return the run from above as the text of an SVG file, with the place that decided."""
        from daemon.analysis.report.run_maps import run_drawing
        from templates.picture import picture_svg

        return picture_svg(run_drawing(self.recorded))

    def _repr_svg_(self) -> str:
        return self.picture()


def _parse_signal(name: str) -> tuple[language.Oracle, language.Signal]:
    """Return an oracle about a signal, and the signal."""
    from grammars.oracle import Signal, Statistic, Temporal, parse_oracle

    # Signals have no grammar of their own, so an oracle about one is parsed: "max" takes
    # quantities, "never" the others. The first error is raised: most signals are quantities.
    where = Where(f"signal {name}".strip())
    hint = "name one, such as clearance or loc.error"
    if not name.strip():
        raise InputError.at(where, "a name is missing", hint)
    errors: list[InputError] = []
    for function in ("max", "never"):
        try:
            oracle = parse_oracle(name, f"{function}({name})", where)
        except InputError as error:
            errors.append(error)
            continue
        match oracle.judgement:
            case Statistic(signal=Signal() as signal) | Temporal(predicate=Signal() as signal):
                return oracle, signal
        raise InputError.at(where, f'"{name}" is no signal', hint)
    raise errors[0]
