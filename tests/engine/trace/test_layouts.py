"""Layouts write exactly the bytes rosbags would."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from daemon.model import ros_messages as ros
from daemon.model.sut import CostmapPicture
from daemon.trace import decode_path, encode_costmap, encode_path, layouts, messages
from daemon.trace.layouts import HEADER, stamps
from grammars.model.grid import OccupancyGrid
from tests.engine.trace.recordings import ROBOT

LAYOUTS = {
    "clock": lambda: layouts.clock(),
    "odometry": lambda: layouts.odometry("/odom", "odom"),
    "ground truth": lambda: layouts.odometry("/ground_truth", "map"),
    "one transform": lambda: layouts.transforms((("odom", "base_link"),)),
    "doors": lambda: layouts.transforms(
        (("map", "door-1/leaf"), ("map", "längere/tür"), ("map", "x/y"))
    ),
    "scan": lambda: layouts.scan(ROBOT.laser),
    "command": lambda: layouts.command(),
    "estimate": lambda: layouts.estimate("/pose"),
    "count": lambda: layouts.count(),
    "joints": lambda: layouts.joints(("a.hinge", "bc.slide", "d.hinge")),
    "contact": lambda: layouts.contact("robot", "hall-wall-2"),
}


def random_columns(layout, count):
    random = np.random.default_rng(5)
    empty = np.zeros(count, layout.record)
    columns = {
        name: random.integers(0, 2**32 - 1, empty[name].shape)
        if name == "count"
        else random.normal(0.0, 100.0, empty[name].shape)
        for name in layout.names
    }
    for values in columns.values():
        if values.dtype.kind == "f":
            values.flat[: min(3, values.size)] = [np.nan, np.inf, -0.0][: values.size]
    return columns


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_message_is_what_rosbags_serializes(name):
    layout = LAYOUTS[name]()
    kind = messages.KINDS[layout.topic]
    times = np.array([0, 50_000_000, 2_147_483_647_999_999_999], np.int64)
    rows = layout.encode(7, times, random_columns(layout, 3))
    for time, row in zip(times.tolist(), rows, strict=True):
        head, payload = row[: HEADER.size].tobytes(), row[HEADER.size :].tobytes()
        assert HEADER.unpack(head) == (5, len(row) - 9, 7, 0, time, time)
        assert ros.serialize(ros.deserialize(payload, kind), kind) == payload


@pytest.mark.parametrize("name", LAYOUTS)
def test_values_land_in_the_fields_they_are_named_after(name):
    layout = LAYOUTS[name]()
    columns = random_columns(layout, 2)
    records = layout.view(layout.encode(1, np.array([3, 4]), columns))
    for field in layout.names:
        if not field.startswith("stamp"):
            expected = columns[field].astype(records[field].dtype)
            np.testing.assert_array_equal(records[field], expected)


def test_covariances_lie_where_ros_expects_x_y_and_yaw():
    layout = LAYOUTS["estimate"]()
    columns = {name: np.array([0.0]) for name in layout.names}
    columns |= {f"c{i}": np.array([i + 1.0]) for i in range(9)}
    row = layout.encode(1, np.array([0]), columns)[0]
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    full = ros.deserialize(row[HEADER.size :].tobytes(), kind).pose.covariance.reshape(6, 6)
    np.testing.assert_array_equal(
        full[np.ix_([0, 1, 5], [0, 1, 5])], np.arange(1.0, 10.0).reshape(3, 3)
    )
    assert np.count_nonzero(full) == 9


def test_a_layout_refuses_bytes_of_another_message():
    odom, truth = LAYOUTS["odometry"](), LAYOUTS["ground truth"]()
    rows = odom.encode(1, np.array([1, 2]), random_columns(odom, 2))
    assert odom.fits(rows).all()
    assert odom.fits_all(rows)
    assert not truth.fits(rows).any()
    assert not truth.fits_all(rows)
    rows[1, HEADER.size + 14] ^= 1
    assert odom.fits(rows).tolist() == [True, False]
    assert not odom.fits_all(rows)
    assert odom.fits_all(rows[:0])
    assert not odom.fits_all(rows[:, 1:])


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_a_stamp_is_seconds_and_nanoseconds(time):
    raw = stamps(np.array([time])).tobytes()
    seconds, rest = divmod(time, 10**9)
    assert raw == seconds.to_bytes(4, "little") + rest.to_bytes(4, "little")


@given(
    arrays(np.float64, st.tuples(st.integers(0, 40), st.just(2))), st.integers(0, 2**31 * 10**9 - 1)
)
def test_a_path_is_what_rosbags_serializes(points, now):
    data = encode_path(now, points)
    message = ros.deserialize(data, "nav_msgs/msg/Path")
    assert ros.serialize(message, "nav_msgs/msg/Path") == data
    found = [(p.pose.position.x, p.pose.position.y) for p in message.poses]
    np.testing.assert_array_equal(np.array(found).reshape(-1, 2), points)
    np.testing.assert_array_equal(decode_path(data), points)
    for wrong in (data[:-1], data + b"\0", b""):
        with pytest.raises(ValueError, match="another size"):
            decode_path(wrong)
    with pytest.raises(ValueError, match="shape"):
        encode_path(0, np.zeros((4, 3)))
    for header in (message.header, *(p.header for p in message.poses)):
        assert header.stamp.sec * 10**9 + header.stamp.nanosec == now
        assert header.frame_id == "map"


@pytest.mark.parametrize("frame", ["map", "odom"])
def test_a_costmap_is_what_rosbags_serializes(frame):
    cells = np.arange(256, dtype=np.uint8).reshape(8, 32)[:, :31]
    now = 2_147_483_647_999_999_999
    data = encode_costmap(now, CostmapPicture(0.0, frame, 0.05, -1.25, 7.0, cells))
    grid = ros.deserialize(data, "nav_msgs/msg/OccupancyGrid")
    assert ros.serialize(grid, "nav_msgs/msg/OccupancyGrid") == data
    published = OccupancyGrid(0.05, -1.25, 7.0, grid.data.reshape(cells.shape))
    expected = ros.occupancy_grid(published, now, frame)
    assert ros.serialize(expected, "nav_msgs/msg/OccupancyGrid") == data
