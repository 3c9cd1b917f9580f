"""What a campaign file says about its results: repeats, comparisons, expectations, the gate.

Comparisons and policies are sentences (``delay(S3.2 vs S3.5) <= 30 s``, ``rate >= 80 %``), so that
no value starts with a sign that means something to YAML.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from daemon.assessment import Policy, Rule
from grammars.documents import Ratio, Written
from grammars.quantity import read_as

_MOST_REPEATS: Final = 100_000
_RATE: Final = re.compile(r"rate\s*>=\s*(?P<rate>[^<>=]+)")


def read_rule(text: str) -> tuple[Rule, float]:
    """Read ``all``, ``mean`` or ``rate >= 80 %`` to a rule and its rate; raises ``ValueError``."""
    words = text.strip()
    if words in ("all", "mean"):
        return ("all", 1.0) if words == "all" else ("mean", 1.0)
    found = _RATE.fullmatch(words)
    if found is None:
        raise ValueError(f'"{text}" is not a rule: write all, mean or rate >= 80 %')
    rate = read_as(found["rate"].strip(), "ratio")
    if not 0.0 < rate < 1.0:
        raise ValueError(
            f"no number of runs shows a rate of {found['rate'].strip()}: "
            "write one above 0 and below 100 %, or all"
        )
    return "rate", rate


def _checked_rule(text: str) -> str:
    read_rule(text)
    return text


def _counted(value: Any) -> Any:
    """Take a plain number of repeats for ``{n: number}``."""
    if isinstance(value, bool) or not isinstance(value, int | dict):
        raise ValueError("must be a whole number, or {n: 5, pass: rate >= 80 %}")
    return {"n": value} if isinstance(value, int) else value


class _RepeatsText(Written):
    """How often every cell is run, and when all its runs together pass."""

    n: int = Field(ge=1, le=_MOST_REPEATS)
    """Runs of every scenario; the same repeat sees the same noise in each of them."""
    rule: Annotated[str, AfterValidator(_checked_rule)] = Field(default="all", alias="pass")
    """all: every run passes; rate >= 80 %: it is shown that so many do (exact, 95 %);
    mean: it is shown that the mean margin is not below 0 (t, 95 %)."""
    until: Literal["decided"] | None = None
    """decided: cells that are neither shown to pass nor to fail get more runs, up to at-most."""
    at_most: int | None = Field(default=None, ge=1, le=_MOST_REPEATS, alias="at-most")
    """So many runs of a cell and no more; needed with "until: decided"."""

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
    _RepeatsText, BeforeValidator(_counted, json_schema_input_type=int | _RepeatsText)
]
ONCE: Final = _RepeatsText(n=1)


def policy_of(text: _RepeatsText) -> Policy:
    """Return the policy that ``repeats:`` means."""
    rule, rate = read_rule(text.rule)
    return Policy(text.n, rule, rate, text.until is not None, text.at_most or text.n)


def _as_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


class ExpectText(Written):
    """What is known to be otherwise than passing; a surprise pass is reported too."""

    scenario: str = "*"
    """Name of a scenario, or a pattern such as S3.*; all when left out."""
    oracle: str = "*"
    """Name of an oracle or of a comparison, or a pattern; all when left out."""
    sut: Annotated[list[str], BeforeValidator(_as_list, json_schema_input_type=str | list[str])] = (
        Field(default_factory=list)
    )
    """Systems under test, names or patterns; all when left out."""
    verdict: Literal["pass", "fail", "mixed", "any"]
    """pass; fail: in every run; mixed: in at least one run; any: whatever comes out."""
    why: str = Field(min_length=1)
    """Why this is so; it is shown beside the verdict."""

    @model_validator(mode="after")
    def _about_something(self) -> ExpectText:
        if self.scenario == self.oracle == "*":
            raise ValueError('name a "scenario" or an "oracle" it is about')
        return self


class GateText(Written):
    """Fail when results get worse than those of another campaign."""

    baseline: str = Field(min_length=1)
    """Id or name of a campaign, a JSON file of results, or last-green: the newest earlier run of
    this campaign in which everything was as expected."""
    worse_by: Ratio = Field(alias="worse-by", ge=0.0)
    """By how much a margin or the duration may get worse, such as 10 %."""
