"""Small buildings to drive in: outer walls, a wall with doorways between two rooms."""

SIZE = (9.0, 5.0)
OUTER = [(0, 0, 9, 0.2), (0, 4.8, 9, 5), (0, 0, 0.2, 5), (8.8, 0, 9, 5)]

ONE_DOORWAY = [*OUTER, (4.4, 0, 4.6, 1.1), (4.4, 2.05, 4.6, 5)]
"""Two rooms and a doorway of 0.95 m around y = 1.575."""
DOOR = (4.47, 1.1, 4.52, 2.05)
"""A shut leaf in it."""

TWO_DOORWAYS = [
    *OUTER, (4.4, 0, 4.6, 1.1), (4.4, 2.05, 4.6, 3.4), (4.4, 4.4, 4.6, 5),
]  # fmt: skip
"""The same with a second doorway, 1 m around y = 3.9."""
