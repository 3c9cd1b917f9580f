"""Layers to search: doors whose times have names."""

import pytest

DOORS = """\
parameter swing = 60 deg/s
parameter closes = 6 s
parameter opens = 14 s
group leading: bedroom_door

all leading moves to open at 0 s, to closed at closes, to open at opens, by servo at swing
living_room_door toggles between closed and open every 5 s with probability 0.5
"""


@pytest.fixture
def doors():
    return DOORS


@pytest.fixture
def folder(demo, doors):
    """The layers of the demonstration with such doors."""
    (demo / "doors_moving.scenery").write_text(doors)
    return demo
