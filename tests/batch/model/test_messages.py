"""Messages of the bus: the numbers that workers may say."""

import json
from dataclasses import replace

import pytest

from daemon.model.messages import Completion
from daemon.model.spec import LeadingMargin
from daemon.model.verdicts import Evidence, Outcome, Verdict
from grammars.text import codec
from tests.make import make_result, make_spec

EVIDENCE = Evidence(1.0, 0.5, 0.2)
VERDICT = Verdict("o", "never(contact)", Outcome.PASS, 0.1, 0.2, "m", EVIDENCE)
LEADS = (LeadingMargin("o", 0.1, "m"),)
RESULT = replace(make_result(make_spec()), verdicts=(VERDICT,), leads=LEADS)
COMPLETION = codec.to_plain(Completion("w", "c.0", 1, 1, RESULT))


def numbers(value, path=()):
    """Yield the path of every number in a document."""
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        if isinstance(inner, dict | list):
            yield from numbers(inner, (*path, key))
        elif isinstance(inner, int | float) and not isinstance(inner, bool):
            yield (*path, key)


NUMBERS = list(numbers(COMPLETION))
SIGNED = {"lower", "upper", "value", "limit", "margin"}


@pytest.mark.parametrize("path", NUMBERS, ids=lambda path: ".".join(map(str, path)))
def test_no_number_of_a_result_is_beyond_what_a_run_can_give(path):
    assert len(NUMBERS) == 14
    negative = () if path[-1] in SIGNED else (-1,)
    for wrong in (float("nan"), float("inf"), float("-inf"), 1e300, *negative):
        document = json.loads(json.dumps(COMPLETION))
        place = document
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = wrong
        with pytest.raises(ValueError, match=str(path[-1])):
            codec.from_json(Completion, json.dumps(document), exactly=True)
