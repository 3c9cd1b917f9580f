"""The oracle language: what must hold for a run, one line per oracle, with units."""

from grammars.oracle._dimension import Dimension
from grammars.oracle._layer import load_oracles
from grammars.oracle._model import (
    Amount,
    Arithmetic,
    Comparison,
    Expression,
    Function,
    Judgement,
    Limit,
    Logic,
    Not,
    Number,
    Oracle,
    Reached,
    Signal,
    Statistic,
    Temporal,
)
from grammars.oracle._parse import parse_oracle
from grammars.oracle._render import render
from grammars.oracle._scope import JointReference, check_scene, object_signals, signals_of
from grammars.oracle._types import kind_of, margin_kind
from grammars.oracle._vocabulary import OBJECT_SIGNALS, SIGNALS, SignalKind, signal_kind

__all__ = [
    "OBJECT_SIGNALS",
    "SIGNALS",
    "Amount",
    "Arithmetic",
    "Comparison",
    "Dimension",
    "Expression",
    "Function",
    "JointReference",
    "Judgement",
    "Limit",
    "Logic",
    "Not",
    "Number",
    "Oracle",
    "Reached",
    "Signal",
    "SignalKind",
    "Statistic",
    "Temporal",
    "check_scene",
    "kind_of",
    "load_oracles",
    "margin_kind",
    "object_signals",
    "parse_oracle",
    "render",
    "signal_kind",
    "signals_of",
]
