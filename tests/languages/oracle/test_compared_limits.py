"""On which side of a constant a signal speaks against an oracle."""

import pytest

from grammars.oracle import compared_limits, parse_oracle
from grammars.text.diagnostics import Where


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("always(speed <= 0.5 m/s)", [("speed", 0.5, "above")]),
        ("always(0.5 m/s >= speed)", [("speed", 0.5, "above")]),
        ("never(clearance < 0.1 m)", [("clearance", 0.1, "below")]),
        ("always(not (speed > 1 m/s))", [("speed", 1.0, "above")]),
        ("always(loc.error.yaw >= -0.1 rad)", [("loc.error.yaw", -0.1, "below")]),
        ("eventually(speed > 0.2 m/s)", [("speed", 0.2, "")]),
        ("max(speed) <= 0.6 m/s", [("speed", 0.6, "above")]),
        ("min(clearance) >= 0.1 m", [("clearance", 0.1, "below")]),
        ("mean(speed) >= 0.1 m/s", [("speed", 0.1, "")]),
        ("max(speed)", []),
        ("fraction(loc.error <= 0.5 m) >= 80 %", [("loc.error", 0.5, "above")]),
        ("time(loc.error > 0.5 m) <= 3 s", [("loc.error", 0.5, "above")]),
        ("fraction(loc.error <= 0.5 m)", [("loc.error", 0.5, "")]),
        ("always(speed <= 1 m/s and clearance >= 0.1 m)",
         [("speed", 1.0, "above"), ("clearance", 0.1, "below")]),
        ("always(speed <= 1 m/s or clearance >= 0.1 m)",
         [("speed", 1.0, ""), ("clearance", 0.1, "")]),
        ("never(speed > 1 m/s or clearance < 0.1 m)",
         [("speed", 1.0, "above"), ("clearance", 0.1, "below")]),
        ("always(speed < 3 m/s) until (elapsed >= 5 s)",
         [("speed", 3.0, "above"), ("elapsed", 5.0, "")]),
        ("never(contact)", []),
    ],
)  # fmt: skip
def test_a_limit_says_which_side_speaks_against_the_oracle(text, found):
    oracle = parse_oracle("it", text, Where("it"))
    assert [(one.signal, one.value, one.against) for one in compared_limits(oracle)] == found
