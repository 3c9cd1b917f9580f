"""Expressions of $(eval …) have Python's values where they have one, and never do anything."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.text.diagnostics import InputError
from tests.languages.launched import AMCL, node, started
from tests.languages.plans import answers

ARGS = {"n": "3", "x": "0.5", "name": "robot1", "on": "true", "empty": ""}
VALUES = {"n": 3, "x": 0.5, "name": "robot1", "on": True, "empty": ""}
DECLARED = "".join(f'<arg name="{name}" default="{value}"/>' for name, value in ARGS.items())


def worked_out(folder, expression, **given_):
    escaped = expression.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    param = f'<param name="v" type="str" value="$(eval {escaped})"/>'
    loaded = started(folder, DECLARED + AMCL.format(param), **given_)
    return node(loaded, "/amcl").parameters["v",].value


def test_what_launch_files_use_has_the_value_roslaunch_gives_it(golden, tmp_path):
    def value(expression):
        return worked_out(tmp_path, expression, env={"B": "c"})

    golden("tables/launch_expressions.txt", answers("tables/launch_expressions.txt", value))


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("(" * 300 + "1" + ")" * 300, "is no"), ("1 + " * 600 + "1", "longer than"),
        ("str((((1,) * 999,) * 999,) * 999)", "repeats a list"),
        ("b'%999999999d' % 1", "not a value"), ("'a' * 2001", "too long"),
        ("name.split", "not supported here"), ("sqrt", "not a value"),
    ],
)  # fmt: skip
def test_monsters_are_refused(tmp_path, expression, expected):
    with pytest.raises(InputError, match=r"a\.launch:2:") as caught:
        worked_out(tmp_path, expression)
    assert expected in str(caught.value)


_numbers = st.integers(-9, 9).map(str) | st.sampled_from(["n", "x", "0.5", "on"])
_texts = st.sampled_from(["'a'", "name", "empty", "''"])
_expressions = st.recursive(
    _numbers | _texts,
    lambda inner: st.one_of(
        st.builds("({} {} {})".format, inner,
                  st.sampled_from(["+", "-", "*", "/", "//", "%", "==", "!=", "<", ">=", "and",
                                   "or", "in"]), inner),
        st.builds("(not {})".format, inner),
        st.builds("({} if {} else {})".format, inner, inner, inner),
        st.builds("str({})".format, inner),
    ),
    max_leaves=8,
)  # fmt: skip


@given(expression=_expressions)
def test_expressions_have_the_values_python_gives_them(expression, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp()
    try:
        expected = str(eval(expression, {"str": str}, dict(VALUES)))
    except (TypeError, ValueError, ArithmeticError):
        with pytest.raises(InputError):
            worked_out(folder, expression)
        return
    assert worked_out(folder, expression) == expected.strip()
