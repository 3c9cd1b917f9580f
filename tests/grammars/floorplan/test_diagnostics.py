"""What people are told when a plan cannot be understood."""

import pytest

from grammars.floorplan import parse_floorplan
from grammars.text.diagnostics import InputError

HEAD = "Floor plan: t\nDefaults: walls: thickness: 0.2 m height: 2.5 m\n"
HERE = "location: wrt: world of: this"
RECT = "shape: Rectangle width=4 m, length=2 m"
ROOM = f"Space a: {RECT} {HERE}\n"


def refused(text):
    with pytest.raises(InputError) as caught:
        parse_floorplan(text, "building.fpm")
    assert str(caught.value)
    return list(caught.value.diagnostics)


def first(body):
    return str(refused(HEAD + body)[0])


def test_a_wall_index_out_of_range_tells_the_walls_there_are():
    text = HEAD + ROOM + f"Space b: {RECT} location:\n    of: this\n    wrt: a.walls[7]"
    assert [str(d) for d in refused(text)] == [
        'building.fpm:6:10: wall index 7: space "a" has walls 0..3'
    ]


def test_all_problems_are_reported_at_once():
    found = refused(
        HEAD
        + f"Space a: shape: Circle radius=-1 m {HERE} of: this\n"
        + f"Space b: {RECT} location: wrt: c of: a translation: z: 1 m\n"
        + f"Space b: {RECT} location: of: this\n"
        + "Entryway e: shape: Rectangle width=w, length=1 m location: wrt: a\n"
    )
    assert [(d.where.line, d.message) for d in found] == [
        (3, "the radius of a circle must be positive, not -1 m"),
        (3, '"of" is given twice'),
        (4, 'unknown space "c"'),
        (4, '"of" names a frame of the space itself, not "a"'),
        (4, "the translation of a space along z must be 0"),
        (5, 'space "b" has no "wrt" in its location'),
        (5, 'space "b" is already defined in line 4'),
        (6, 'entryway "e" has no "in" in its location'),
        (6, "the rectangle of an opening has a height, not a length"),
        (6, 'unknown variable "w"'),
        (6, 'an entryway has no "wrt"'),
    ]


def test_every_element_with_a_syntax_error_is_reported():
    found = refused(
        HEAD
        + f"Space a: shape: Rectangle width=40 ft, length=2 m {HERE}\n"
        + ROOM.replace("a:", "b:")
        + f"Space c: shap: Circle radius=1 m {HERE} // Space x: in a comment\n"
        + f"Space d: {RECT} location: wrt: world of: this spced\n"
    )
    assert [(d.where.line, d.where.column) for d in found] == [(3, 36), (5, 10), (6, 79)]
    assert [d.hint for d in found] == [
        "lengths are in m, cm or mm, angles in deg or rad",
        'did you mean "shape"?',
        'did you mean "spaced"?',
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", '1:1: unexpected the end of the file; expected "Floor plan"'),
        (ROOM, '1:1: unexpected "Space"; expected "Floor plan"'),
        ("Floor plan t", '1:12: unexpected "t"; expected ":"'),
        ("Floor plan: t", 'plan "t" has no spaces'),
        (HEAD + "var v = 3\n" + ROOM, '3:10: expected a unit (such as m, cm or deg) after "3"'),
        (HEAD + "var v = w", '3:9: unexpected "w"; expected a number'),
        (HEAD + "Space 1a:", '3:7: unexpected "1a"; expected a name'),
        (HEAD + "Space a: shape: Oval", "expected a shape (Rectangle, Circle or Polygon)"),
        pytest.param(
            HEAD + ROOM + "x" * 5000, 'unexpected "' + "x" * 40 + '"; expected', id="long"
        ),
    ],
)
def test_syntax_errors_are_told_in_the_words_of_the_language(text, message):
    assert message in str(refused(text)[0])


@pytest.mark.parametrize(
    ("body", "hint"),
    [
        (f"Space a: shape: Rectangle width=1,5 m, length=2 m {HERE}", "with a point: 1.5"),
        (f"Space a: shape: Rectangle width=1 m, length=2,5 m {HERE}", "with a point: 1.5"),
        (f"Space a: shape: Rectangle width=4.0m, length=2 m {HERE}", "write a blank between"),
        (f"Space a: shape: Rectangle width=w/2, length=2 m {HERE}", "there is no arithmetic"),
        (ROOM + "p1: (0 m, 0 m)", "walls are not written"),
        (ROOM + "frame: foo", "frames cannot be named"),
        (ROOM + "thickness: 0.5 m", 'inside "walls:"'),
        (ROOM + "wall: thickness: 0.5 m", 'are written "walls:"'),
        (ROOM + "features: walls: thickness: 0.5 m", "in this order"),
        (ROOM + "# comment", "comments start with //"),
        (ROOM + "Default values: walls:", 'are written "Defaults:"'),
    ],
)
def test_common_slips_get_a_hint(body, hint):
    assert hint in first(body)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (ROOM + "var x = 1 m", 'variable "x" comes too late'),
        ("Defaults: " + ROOM, '"Defaults:" is given twice'),
        (f"Space a: {RECT} {HERE} walls: height: 1 m height: 2 m", '"height" is given twice'),
        (f"Space a: {RECT} {HERE} translation: x: 1 m, x: 2 m", '"x" is given twice in this tr'),
        (f"Space a: {RECT} {HERE} spaced", '"wrt" is the world'),
        (f"Space a: {RECT} {HERE} in: a.walls[0]", 'a space has no "in"'),
        (f"Space a: {RECT} {HERE} rotation: x: 1 deg", "the rotation of a space about x must be 0"),
        (f"Space a: {RECT} {HERE}.walls[4]", 'wall index 4: space "a" has walls 0..3'),
        (f"Space a: {RECT} location: of: this wrt: world.walls[0]", "the world has no walls"),
        (f"Space a: {RECT} location: of: this wrt: this", "placed against itself"),
        (f"Space a: {RECT} location: of: this wrt: a.walls[1]", "placed against itself"),
        (f"Space a: {RECT} {HERE} translation: x: 1 deg", 'expected a length, not "1 deg"'),
        (f"Space a: {RECT} {HERE} rotation: z: 1 m", 'expected an angle, not "1 m"'),
        (f"var v = 1 m {ROOM.strip()} rotation: z: v", 'but variable "v" is in m'),
        (f"Space a: {RECT} {HERE} translation: x: 1e999 m", "1e999 is too large"),
        (f"Space a: shape: Rectangle width=0 m, length=2 m {HERE}", "must be positive"),
        (f"Space a: shape: Rectangle width=1 m, height=2 m {HERE}", "has a length, not a height"),
        (f"Space a: shape: Polygon points: [] {HERE}", "needs 3 different points, not 0"),
        (f"Space a: shape: Polygon points: [(1, 1), (2, 1, 0, 0)] {HERE}", "2 or 3 coordinates"),
        (f"Space a: shape: Polygon points: [(0,0,1), (1,1), (0,1)] {HERE}", "z must be 0"),
        (f"Space a: shape: Polygon points: [(0,0), (2,0), (1,0)] {HERE}", "turns back on itself"),
        (f"Space a: shape: Polygon points: [(0,0), (1,1), (1,0), (0,1)] {HERE}", "edges 0 and 2"),
        (
            f"Space a: shape: Polygon points: [(0,0), (0,2), (1,0), (2,2), (2,0)] {HERE}",
            "crosses or touches itself",
        ),
        (ROOM + "Column c: shape: Circle radius=1 height: 1 location: wrt: this", '"this" has no'),
        (
            ROOM + "Column c: shape: Circle radius=1 height: 1 location: wrt: world",
            "not in the wor",
        ),
        (ROOM + "Column c: shape: Circle radius=1 height: 1 location: wrt: aa", 'mean "a"?'),
        (ROOM + "Window w: shape: Circle radius=1 location: in: this.walls[0]", '"this" has no'),
        (ROOM + "Window w: shape: Circle radius=1 location: in: a", 'but "a" is a space'),
        (
            ROOM + "Window w: shape: Circle radius=1 location: in: a.walls[0] and a.walls[-4]",
            "the same wall twice",
        ),
        (
            ROOM + "Window w: shape: Circle radius=1 location: in: "
            "a.walls[0] and a.walls[1] and a.walls[2]",
            "one or two walls",
        ),
    ],
)
def test_what_has_no_meaning_is_refused(body, message):
    assert any(message in str(d) for d in refused(HEAD + body))


def test_defaults_come_first():
    found = refused(f"Floor plan: t {ROOM} Defaults: walls: thickness: 1 m height: 2 m")
    assert '"Defaults:" comes too late' in [d.message for d in found]


def test_spaced_excludes_a_gap_of_its_own():
    location = "location: wrt: a.walls[0] of: this.walls[2] spaced translation: y: 1 m"
    assert "exclude each other" in first(ROOM + f"Space b: {RECT} {location}")


def test_missing_wall_dimensions_are_reported_per_space():
    found = refused(
        f"Floor plan: t Space a: {RECT} {HERE} walls: height: 2 m Space b: {RECT} {HERE}"
    )
    assert [d.message for d in found] == [
        'space "a" has no wall thickness',
        'space "b" has no wall thickness and height',
    ]


def test_a_loop_of_placements_is_told_once():
    rooms = "".join(
        f"Space {name}: {RECT} location: of: this wrt: {against}\n"
        for name, against in [("a", "b"), ("b", "c"), ("c", "b"), ("d", "a")]
    )
    (loop,) = refused(HEAD + rooms)
    assert '"b" -> "c" -> "b"' in loop.message


def test_a_long_chain_of_rooms_is_placed_without_recursion():
    count = 1500
    rooms = "".join(
        f"Space s{k}: {RECT} location: of: this translation: x: 5 wrt: s{k + 1}\n"
        for k in range(count)
    )
    last = f"Space s{count}: {RECT} {HERE}"
    plan = parse_floorplan(HEAD + rooms + last)
    assert plan.spaces[0].frame.x == 5.0 * count
