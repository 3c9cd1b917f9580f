"""The oracle language: requirements on a run with units, one line per oracle."""

from grammars.oracle._bounds import RunOutline, check_bounds
from grammars.oracle._checks import kind_of, margin_kind, unit_of
from grammars.oracle._limits import ComparedLimit, compared_limits
from grammars.oracle._model import (
    ROBOT,
    Amount,
    CustomCall,
    Judgement,
    Leg,
    Limit,
    Oracle,
    Reached,
    Response,
    Signal,
    Statistic,
    Temporal,
    Until,
    thing_of,
)
from grammars.oracle._parse import load_oracles, parse_oracle
from grammars.oracle._references import (
    JointReference,
    check_references,
    leg_number,
    object_signals,
    obstacle_names,
)
from grammars.oracle._signals import (
    OBJECT_SIGNALS,
    SIGNALS,
    CustomOracle,
    CustomSignal,
    SignalDeclaration,
    custom_oracle,
    custom_oracle_names,
    custom_signal,
    custom_signal_names,
    signal_declaration,
)
from grammars.oracle._spots import check_spots

__all__ = [
    "OBJECT_SIGNALS",
    "ROBOT",
    "SIGNALS",
    "Amount",
    "ComparedLimit",
    "CustomCall",
    "CustomOracle",
    "CustomSignal",
    "JointReference",
    "Judgement",
    "Leg",
    "Limit",
    "Oracle",
    "Reached",
    "Response",
    "RunOutline",
    "Signal",
    "SignalDeclaration",
    "Statistic",
    "Temporal",
    "Until",
    "check_bounds",
    "check_references",
    "check_spots",
    "compared_limits",
    "custom_oracle",
    "custom_oracle_names",
    "custom_signal",
    "custom_signal_names",
    "kind_of",
    "leg_number",
    "load_oracles",
    "margin_kind",
    "object_signals",
    "obstacle_names",
    "parse_oracle",
    "signal_declaration",
    "thing_of",
    "unit_of",
]
