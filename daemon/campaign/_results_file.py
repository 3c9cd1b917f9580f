"""The keys of a campaign file about results: the number of runs, and the demands on them.

Policies are sentences (``rate >= 80 %``), so that no value starts with a special sign of YAML.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from daemon.campaign._names import Names
from daemon.model.assessments import PolicyRule, RepeatPolicy
from grammars.text.documents import StrictModel, text_or
from grammars.text.quantity import Ratio, read_as

_MOST_REPEATS: Final = 100_000
"""Largest number that tests submit in one campaign."""
_RATE: Final = re.compile(r"rate\s*>=\s*(?P<rate>[^<>=]+)")


def read_rule(text: str) -> tuple[PolicyRule, float]:
    """Read ``all``, ``mean`` or ``rate >= 80 %``; return rule and rate; raises ``ValueError``."""
    words = text.strip()
    if words in ("all", "mean"):
        return ("all", 1.0) if words == "all" else ("mean", 1.0)
    rule = _RATE.fullmatch(words)
    if rule is None:
        raise ValueError(f'"{text}" is not a rule: write all, mean or rate >= 80 %')
    rate = read_as(rule["rate"].strip(), "ratio")
    # No finite number of passes excludes a rate just below 100 %; "all" is the closest rule.
    if not 0.0 < rate < 1.0:
        raise ValueError(
            f"no number of runs shows a rate of {rule['rate'].strip()}: "
            "write one above 0 and below 100 %, or all"
        )
    return "rate", rate


def _check_rule(text: str) -> str:
    read_rule(text)
    return text


def _repeats_mapping(value: Any) -> Any:
    """Turn a plain number of repeats into ``{n: number}``."""
    # bool is an int in Python: "repeats: true" would be one run.
    if isinstance(value, bool) or not isinstance(value, int | dict):
        raise ValueError("must be a whole number, or {n: 5, pass: rate >= 80 %}")
    return {"n": value} if isinstance(value, int) else value


class _RepeatsText(StrictModel):
    """Number of runs of every cell, and the rule by which they pass together."""

    n: int = Field(ge=1, le=_MOST_REPEATS)
    """Runs of every scenario; the same repeat has the same noise in each of them."""
    rule: Annotated[str, AfterValidator(_check_rule)] = Field(default="all", alias="pass")
    """all: every run passes; rate >= 80 %: the runs show this pass rate (exact, 95 %);
    mean: the runs show that the mean margin is not below 0 (t, 95 %)."""
    until: Literal["decided"] | None = None
    """decided: cells shown neither to pass nor to fail get more runs, up to at-most."""
    at_most: int | None = Field(default=None, ge=1, le=_MOST_REPEATS, alias="at-most")
    """Most runs of a cell; required with "until: decided"."""

    @model_validator(mode="after")
    def _sensible(self) -> _RepeatsText:
        rule, _ = read_rule(self.rule)
        if (self.until is None) != (self.at_most is None):
            raise ValueError('"until: decided" and "at-most" need each other')
        if self.at_most is not None and self.at_most <= self.n:
            raise ValueError(f'"at-most: {self.at_most}" leaves nothing to add to n: {self.n}')
        if self.until and rule == "all":
            raise ValueError(
                '"until: decided" needs "pass: rate >= 80 %" or "pass: mean": '
                "the first run that fails decides all"
            )
        if rule == "mean" and self.n < 2:
            raise ValueError('"pass: mean" needs n: 2 or more, one run does not say how they vary')
        return self


RepeatsText: TypeAlias = Annotated[
    _RepeatsText, BeforeValidator(_repeats_mapping, json_schema_input_type=int | _RepeatsText)
]
ONCE: Final = _RepeatsText(n=1)


def repeat_policy(text: _RepeatsText) -> RepeatPolicy:
    """Return the policy of ``repeats:``."""
    rule, rate = read_rule(text.rule)
    return RepeatPolicy(text.n, rule, rate, text.until is not None, text.at_most or text.n)


class ExpectText(StrictModel):
    """An expected verdict, and why; an unexpected pass is reported too."""

    scenario: str = "*"
    """Name of a scenario, or a pattern such as S3.*; by default all."""
    oracle: str = "*"
    """Name of an oracle or of a comparison, or a pattern; by default all."""
    sut: Names = Field(default_factory=list)
    """Systems under test, names or patterns; by default all."""
    verdict: Literal["pass", "fail", "mixed", "any"]
    """pass; fail: a failure in every run; mixed: in at least one run; any: no expectation."""
    why: str = Field(min_length=1)
    """The reason, shown beside the verdict."""

    @model_validator(mode="after")
    def _about_something(self) -> ExpectText:
        if self.scenario == self.oracle == "*":
            raise ValueError('name its "scenario" or its "oracle"')
        return self


class AllowText(StrictModel):
    """An intended situation whose warning the check leaves out."""

    warning: str = Field(min_length=1)
    """The text of the warning, * for any text: the leaf of door_12 sweeps *."""
    why: str = Field(min_length=1)
    """Why this is intended."""


class GateText(StrictModel):
    """Fail when results get worse than those of another campaign."""

    baseline: str = Field(min_length=1)
    """Id or name of a campaign, a JSON file of results, or last-green: the newest earlier run of
    this campaign in which everything was as expected."""
    worse_by: Ratio = Field(alias="worse-by", ge=0.0)
    """Share by which a margin or the duration may get worse, such as 10 %."""


# A count needs no unit, and so no quotes.
_Amount: TypeAlias = Annotated[str, text_or(int, float)]


class ValueText(StrictModel):
    """One value of a source."""

    scenario: str = ""
    """Name of a scenario, or a pattern such as S3.*; left out for a comparison."""
    sut: Names = Field(default_factory=list)
    """Systems under test, names or patterns; by default all."""
    oracle: str = Field(min_length=1)
    """Name of a measure, of an oracle, or of a comparison; duration always exists."""
    value: _Amount
    """Value with the unit of the measure, such as 696.08 s; for an oracle with a limit the number
    of passes, such as 3 of 5."""
    statistic: Literal["mean", "median", "min", "max"] = "mean"
    """Statistic of the source over its runs."""
    deviation: _Amount | None = None
    """Standard deviation of the runs."""
    range: Annotated[list[_Amount], Field(min_length=2, max_length=2)] | None = None
    """Least and greatest value, or the bounds of an interval."""
    runs: int | None = Field(default=None, ge=1)
    """Number of runs behind the value."""
    note: str = ""
    """Place in the source, and other remarks."""


class ReferenceText(StrictModel):
    """Values of one source."""

    source: str = Field(min_length=1)
    """Author and place of publication, shown beside the values."""
    values: list[ValueText] = Field(min_length=1)
    """The values, one for each scenario, system and quantity."""
