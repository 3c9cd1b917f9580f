"""Maps as files: what is written reads back, and what ``map_server`` makes of others."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from grammars.model.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from grammars.model.map_files import pack_map, read_map, unpack_map, write_map
from grammars.text.diagnostics import InputError

META = {
    "image": "room.pgm",
    "resolution": "0.05",
    "origin": "[-1.5, 2.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}
FINITE = st.floats(-1e6, 1e6)
SIDES = st.integers(1, 12)


@st.composite
def grids(draw, values):
    rows, columns = draw(SIDES), draw(SIDES)
    size = rows * columns
    cells = draw(st.lists(st.sampled_from(values), min_size=size, max_size=size))
    array = np.array(cells, dtype=np.int8).reshape(rows, columns)
    return OccupancyGrid(draw(st.floats(0.001, 10.0)), draw(FINITE), draw(FINITE), array)


def same(one, other):
    places = (one.resolution, one.x, one.y) == (other.resolution, other.x, other.y)
    return places and np.array_equal(one.cells, other.cells)


@given(grids((FREE, OCCUPIED, UNKNOWN)) | grids(tuple(range(-1, 101))))
def test_what_is_written_reads_back_the_same(tmp_path_factory, grid):
    _, meta = write_map(grid, tmp_path_factory.mktemp("map") / "room", laser_height=0.3)
    read = read_map(meta).grid
    assert same(read, grid)
    assert read.cells.dtype == np.int8
    assert same(unpack_map(pack_map(grid)), grid)


def room(folder, pixels=b"P5 2 1 255\n\x00\xfe", **changes):
    (folder / "room.pgm").write_bytes(pixels)
    keys = META | changes
    path = folder / "room.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in keys.items() if value))
    return path


# By hand from image_loader.cpp of map_server: greys with the values they come to.
@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, {0: 100, 89: 100, 90: -1, 205: -1, 206: 0, 254: 0, 255: 0}),
        ({"negate": "1"}, {255: 100, 166: 100, 165: -1, 50: -1, 49: 0, 0: 0}),
        ({"negate": "true"}, {255: 100, 0: 0}),
        ({"mode": "scale"}, {0: 100, 90: 98, 150: 47, 205: 1, 206: 0, 255: 0}),
        ({"mode": "raw"}, {0: 0, 37: 37, 100: 100, 101: -1, 254: -1, 255: -1}),
        ({"mode": "raw", "negate": "1"}, {255: 0, 155: 100, 154: -1, 0: -1}),
    ],
)
def test_pixels_mean_what_they_mean_to_map_server(tmp_path, changes, expected):
    image = b"P5\n%d 1\n255\n" % len(expected) + bytes(expected)
    grid = read_map(room(tmp_path, image, **changes)).grid
    assert grid.cells.tolist() == [list(expected.values())]
    assert (grid.resolution, grid.x, grid.y) == (0.05, -1.5, 2.0)


@pytest.mark.parametrize(
    "image",
    [
        b"P5 3 2 255\n" + bytes([0, 254, 205, 0, 0, 254]),
        b"P5\n# drawn\n3 2\n#by hand\n255\n" + bytes([0, 254, 205, 0, 0, 254]),
        b"P2\n3 2\n255\n0 254 205\n0 0 254\n",
        b"P2 # ascii\n3\t2 255 0 254 205 # the upper row\n 0 0\n254",
        b"P5 3 2 65535\n" + b"\0\0\xfe\xfe\xcd\xcd\0\0\0\0\xfe\xfe",
        # Of five greys, white is the fifth.
        b"P5 3 2 5\n" + bytes([0, 5, 4, 0, 0, 5]),
    ],
)
def test_the_top_row_of_an_image_is_the_last_of_the_map(tmp_path, image):
    cells = read_map(room(tmp_path, image)).grid.cells
    assert cells.tolist()[1][:2] == [OCCUPIED, FREE]
    assert cells.tolist()[0] == [OCCUPIED, OCCUPIED, FREE]


def test_an_image_lies_beside_the_file_that_names_it(tmp_path):
    (tmp_path / "images").mkdir()
    path = room(tmp_path, image="images/plain.pgm")
    (tmp_path / "room.pgm").rename(tmp_path / "images" / "plain.pgm")
    assert read_map(path).grid.cells.tolist() == [[OCCUPIED, FREE]]


@pytest.mark.parametrize(
    ("image", "complaint"),
    [
        (b"P5 2 1 255\n\x00", r"room.yaml:1:1: the image room.pgm has 1 pixels, .* 2 x 1 = 2"),
        (b"P5 2 1 255\n\x00\x00\x00", "has 3 pixels"),
        (b"P5 2 1 3\n\x00\x04", "pixels above 3"),
        (b"\x89PNG\r\n\x1a\n", "damaged PNG file"),
        (b"P6 65536 65536 255\n", "4294967296 pixels.*at most 64"),
        (b"version https://git-lfs.github.com/spec/v1", "a placeholder of Git LFS"),
    ],
)
def test_an_image_that_is_none_is_refused(tmp_path, image, complaint):
    with pytest.raises(InputError, match=f"(?s){complaint}"):
        read_map(room(tmp_path, image))


def test_keys_of_other_readers_are_left_alone(tmp_path):
    assert read_map(room(tmp_path, laser_height="0.7")).grid.cells.shape == (1, 2)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"{}\n",
        b'{"resolution":0.05,"x":0.0,"y":0.0,"rows":1,"columns":2}\n\x00',
        b'{"resolution":0.05,"x":0.0,"y":0.0,"rows":1,"columns":1}\n\x70',
        b'{"resolution":-1.0,"x":0.0,"y":0.0,"rows":1,"columns":1}\n\x00',
        b'{"resolution":0.05,"x":0.0,"y":0.0,"rows":0,"columns":1}\n',
    ],
)
def test_what_is_no_packed_map_is_refused(data):
    with pytest.raises(ValueError, match="."):
        unpack_map(data)


def shades(mode, values):
    image = Image.new(mode, (len(values), 1))
    image.putdata(values)
    return image


# By hand from image_loader.cpp: a colour is the mean of its channels, alpha among them in trinary.
@pytest.mark.parametrize(
    ("image", "changes", "expected"),
    [
        (shades("L", [0, 89, 90, 205, 206, 254]), {}, [100, 100, -1, -1, 0, 0]),
        (shades("1", [0, 255]), {}, [100, 0]),
        (shades("I;16", [0, 0x5A00, 0xCDCD, 0xFFFF]), {}, [100, -1, -1, 0]),
        (shades("I;16", [0, 0x2500, 0xFFFF]), {"mode": "raw"}, [0, 36, -1]),
        (shades("RGB", [(0, 0, 0), (205, 205, 205), (255, 255, 255)]), {}, [100, -1, 0]),
        (shades("RGB", [(255, 15, 0), (255, 12, 0)]), {}, [-1, 100]),
        (shades("RGBA", [(0, 0, 0, 255), (255, 255, 255, 255)]), {}, [100, 0]),
        (shades("RGBA", [(205, 205, 205, 255), (205, 205, 205, 0)]), {}, [0, -1]),
        (shades("LA", [(0, 255), (254, 255), (205, 0)]), {}, [100, 0, -1]),
        (shades("LA", [(150, 255), (150, 0), (254, 0)]), {"mode": "scale"}, [47, -1, 0]),
        (shades("LA", [(37, 255), (37, 0)]), {"mode": "raw"}, [37, 37]),
        (shades("L", [0, 254]).convert("P"), {"negate": "1"}, [0, 100]),
    ],
)
def test_a_png_means_what_it_means_to_map_server(tmp_path, image, changes, expected):
    path = room(tmp_path, image="room.png", **changes)
    image.save(tmp_path / "room.png")
    assert read_map(path).grid.cells.tolist() == [expected]


@pytest.mark.parametrize("around", [(205, 255), (0, 0)], ids=["opaque", "clear"])
def test_unknown_cells_that_an_alpha_channel_changes_are_told(tmp_path, around):
    image = shades("LA", [(0, 255), around, (254, 255), (254, 255)])
    image.save(tmp_path / "room.png")
    (warning,) = read_map(room(tmp_path, image="room.png")).warnings
    assert "room.yaml:1:1: warning: 25% of the cells differ from their colour" in str(warning)
    assert "without an alpha channel" in warning.hint
    image.convert("L").save(tmp_path / "room.png")
    assert not read_map(room(tmp_path, image="room.png")).warnings


def test_a_turned_map_is_read_for_import(tmp_path):
    saved = read_map(room(tmp_path, origin="[1, 2, 0.5]"), turned=True)
    assert (saved.grid.x, saved.grid.y, saved.yaw) == (1.0, 2.0, 0.5)
    assert saved.grid.cells.tolist() == [[OCCUPIED, FREE]]
    assert not saved.warnings


def test_unknown_cells_that_nav2_would_load_as_free_are_told(tmp_path):
    image = b"P5 4 1 255\n\x00\xcd\xfe\xfe"
    (warning,) = read_map(room(tmp_path, image, free_thresh="0.25")).warnings
    assert "room.yaml:6:1: warning: 25% of the cells are grey 205" in str(warning)
    assert "write free_thresh: 0.196" in str(warning)
    assert not read_map(room(tmp_path, image)).warnings
    # Shades of probability, of which 205 is one of many.
    image = b"P5 4 1 255\n\x00\xcd\xfe\xf0"
    assert not read_map(room(tmp_path, image, free_thresh="0.25")).warnings
