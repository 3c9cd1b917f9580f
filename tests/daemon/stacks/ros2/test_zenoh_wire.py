"""Keys, tokens and attachments of rmw_zenoh."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros2.rmw_zenoh.wire import (
    QosProfile,
    Token,
    attachment,
    dds_name,
    gid,
    kind_of,
    qos_text,
    read_attachment,
    read_qos,
    read_token,
    token_key,
    topic_key,
)

STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"

words = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,20}", fullmatch=True)
names = st.lists(words, min_size=1, max_size=4).map(lambda parts: "/" + "/".join(parts))
kinds = st.tuples(words, st.sampled_from(["msg", "srv", "action"]), words).map("/".join)
profiles = st.builds(
    QosProfile,
    reliable=st.booleans(),
    transient_local=st.booleans(),
    depth=st.integers(0, 100000),
    keep_all=st.booleans(),
)
heads = st.tuples(
    st.integers(0, 232),
    st.from_regex(r"[1-9a-f][0-9a-f]{0,31}", fullmatch=True),
    st.integers(0, 2**40),
    st.integers(0, 2**40),
)
tokens = st.one_of(
    st.builds(lambda head, node: Token(*head, "node", node), heads, names),
    st.builds(
        lambda head, role, *rest: Token(*head, role, *rest),
        heads,
        st.sampled_from(["publisher", "subscription", "server", "client"]),
        names,
        names,
        kinds,
        st.sampled_from([STRING_HASH, "TypeHashNotSupported"]),
        profiles,
    ),
)


def test_the_key_of_a_topic():
    key = topic_key(0, "/chatter", "std_msgs/msg/String", STRING_HASH)
    assert key == f"0/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"
    assert topic_key(5, "/robot1/scan/", "a/msg/B", "h") == "5/robot1/scan/a::msg::dds_::B_/h"


def test_the_token_of_a_subscription():
    qos = QosProfile(reliable=False, depth=5)
    token = Token(
        2, "aac3178e146ba6f1", 0, 11, "subscription", "/robot1/amcl", "/robot1/scan",
        "sensor_msgs/msg/LaserScan", "RIHS01_00", qos,
    )  # fmt: skip
    assert token_key(token) == (
        "@ros2_lv/2/aac3178e146ba6f1/0/11/MS/%/%robot1/amcl/%robot1%scan/"
        "sensor_msgs::msg::dds_::LaserScan_/RIHS01_00/2::,5:,:,:,,"
    )


def test_the_token_of_a_node_in_the_root_namespace():
    token = Token(0, "1", 0, 0, "node", "/listener")
    assert token_key(token) == "@ros2_lv/0/1/0/0/NN/%/%/listener"


@given(tokens)
def test_tokens_are_read_as_they_are_written(token):
    key = token_key(token)
    assert read_token(key) == token
    # Zenoh has no empty chunks.
    assert all(key.split("/"))


@given(tokens, names)
def test_what_later_versions_add_is_not_looked_at(token, more):
    assert read_token(token_key(token) + more) == token


@given(st.text())
def test_no_key_is_trouble(key):
    read_token(key)
    read_token(f"@ros2_lv/{key}")
    read_token("@ros2_lv/0/1/0/0/MP/%/%/node/" + key)


@pytest.mark.parametrize(
    "key",
    ["", "0/chatter/a/b", "@ros2_lv/x/1/0/0/NN/%/%/n", "@ros2_lv/0/1/0/0/XX/%/%/n",
     "@ros2_lv/0/1/0/1/MP/%/%/n/%t", "@ros2_lv/0/1/0/\u0661/NN/%/%/n"],
)  # fmt: skip
def test_what_is_no_token(key):
    assert read_token(key) is None


@pytest.mark.parametrize(
    ("profile", "text"),
    [
        (QosProfile(), "::,10:,:,:,,"),
        (QosProfile(transient_local=True, depth=1), ":1:,1:,:,:,,"),
        (QosProfile(reliable=False, depth=5), "2::,5:,:,:,,"),
        (QosProfile(depth=42), "::,:,:,:,,"),
        (QosProfile(keep_all=True, depth=0), "::2,0:,:,:,,"),
    ],
)
def test_profiles(profile, text):
    assert qos_text(profile) == text
    assert read_qos(text) == profile


@given(profiles)
def test_profiles_are_read_as_they_are_written(profile):
    assert read_qos(qos_text(profile)) == profile


@given(kinds)
def test_types_are_read_as_they_are_written(kind):
    assert kind_of(dds_name(kind)) == kind


def test_a_type_of_another_making_stays_as_it_is():
    assert kind_of("Something") == "Something"


@given(st.integers(1, 2**62), st.integers(0, 2**62), st.binary(min_size=16, max_size=16))
def test_attachments(sequence, time, sender):
    data = attachment(sequence, time, sender)
    assert len(data) == 33
    assert struct.unpack_from("<qqB", data) == (sequence, time, 16)
    assert read_attachment(data) == (sequence, time, sender)


@given(st.binary(max_size=40).filter(lambda data: len(data) != 33))
def test_what_is_no_attachment_is_said(data):
    with pytest.raises(ValueError, match="attachment"):
        read_attachment(data)


def test_an_endpoint_is_known_by_the_hash_of_its_token():
    # XXH3-128 of nothing is 99aa06d3014798d86001c324468d497f (its reference implementation).
    assert gid("") == bytes.fromhex("7f498d4624c30160d8984701d306aa99")
    assert len(gid("@ros2_lv/0/1/0/0/MP")) == 16
