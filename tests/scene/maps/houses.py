"""A hut as a walls layer, for tests of what is made of one."""

from grammars.maps import load_walls

HUT = """\
walls: hut
height: 2.5 m
spaces:
  hall:
    outline: [[0, 0], [6, 0], [6, 4], [0, 4]]
    holes:
      - [[2, 1], [2.5, 1], [2.5, 1.5], [2, 1.5]]
      - [[4, 3], [4.5, 3], [4.5, 3.5], [4, 3.5]]
  kitchen:
    outline: [[6.2, 0], [10, 0], [10, 4], [6.2, 4]]
standing:
  - outline: [[-0.2, -0.2], [10.2, -0.2], [10.2, 4.2], [-0.2, 4.2]]
    holes:
      - [[0, 0], [6, 0], [6, 1], [6.2, 1], [6.2, 0], [10, 0], [10, 4], [6.2, 4], [6.2, 2], [6, 2],
         [6, 4], [0, 4]]
  - {name: post, outline: [[2, 1], [2.5, 1], [2.5, 1.5], [2, 1.5]], height: 1 m}
entryways:
  gap: {from: [6.1, 1], to: [6.1, 2], depth: 20 cm}
"""
"""Two rooms with a gap between them: its way goes up, so the kitchen is to its right."""

DOOR = """
object door
    link post  box 4 cm x 4 cm   at (0 cm, 0 cm)   from 0 m to 1.98 m,    mass 50 kg
    link leaf  box 4 cm x 88 cm  at (0 cm, 47 cm)  from 1 cm to 1.98 m,   mass 15 kg
    joint hinge  revolute from post to leaf at (-2 cm, 2.5 cm), between 0 deg and 90 deg
    state closed: hinge 0 deg
"""


def hut(folder, *changes):
    """Return the hut, with some of its words replaced by others."""
    text = HUT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "hut.walls.yaml"
    path.write_text(text, encoding="utf-8")
    return load_walls(path)
