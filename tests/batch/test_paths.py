"""Places and addresses: state directories, traces, ids, endpoints, disks that are full."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from daemon.batch.amounts import QUOTA_VARIABLE, parse_size, size_text
from daemon.batch.errors import DaemonError
from daemon.batch.launch import ensure_daemon
from daemon.batch.paths import (
    DaemonContact,
    Endpoint,
    StatePaths,
    endpoint_text,
    find_endpoint,
    parse_endpoint,
)
from daemon.model.ids import is_id, is_run_id, trace_name
from grammars.text import codec
from grammars.text.files import write_atomically

names = st.text(min_size=1, max_size=20).filter(lambda text: "\ud800" not in text)
runs = st.tuples(names, names, st.integers(0, 99))


@given(runs, runs)
def test_no_trace_leaves_its_directory_nor_is_that_of_another_run(one, other):
    places = StatePaths(Path("/nowhere"))
    try:
        first, second = trace_name("camp", *one), trace_name("camp", *other)
    except (ValueError, UnicodeEncodeError):
        assume(False)
    path = places.trace(first)
    assert path.parent == places.traces / "camp"
    assert path.name.isprintable()
    assert (first == second) == (one == other)


def test_ordinary_names_stay_readable():
    assert trace_name("demo-1", "S1", "fro-diff", 3) == "demo-1/S1.fro-diff.3.mcap"


@pytest.mark.parametrize("campaign", ["", "..", "a/b", "a.b", "-x", "ä", "a" * 101, "a\n"])
def test_a_campaign_that_is_no_id_has_no_traces(campaign):
    assert not is_id(campaign)
    with pytest.raises(ValueError, match="not a campaign id"):
        trace_name(campaign, "S", "s", 0)


@pytest.mark.parametrize("name", ["../x.mcap", "a/../../b", "a/b/c.mcap", "a/.x", "a", "/etc/x"])
def test_foreign_trace_names_are_refused(name):
    with pytest.raises(ValueError, match="not the name of a trace"):
        StatePaths(Path("/nowhere")).trace(name)


def test_run_ids_are_campaign_and_index():
    assert is_run_id("demo.12")
    wrong = ("demo", "demo.x", "../demo.1", "demo.1/..", "a.b.1", "demo.1\n")
    assert not any(map(is_run_id, wrong))


@pytest.mark.parametrize(
    ("endpoint", "text"),
    [
        ("unixsock-stream//run/scenario/daemon.sock", "/run/scenario/daemon.sock"),
        ("tls/server:7447", "tls/server:7447"),
        ("no", "no"),
    ],
)
def test_people_know_a_socket_by_its_path_and_may_type_it(tmp_path, monkeypatch, endpoint, text):
    assert endpoint_text(endpoint) == text
    assert parse_endpoint(text) == endpoint
    monkeypatch.setenv("SCENARIO_CONNECT", text)
    assert find_endpoint("", tmp_path).address == endpoint


def test_the_state_directory_is_the_argument_then_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "env"))
    assert StatePaths.find(tmp_path / "arg").state == tmp_path / "arg"
    assert StatePaths.find().state == tmp_path / "env"
    monkeypatch.delenv("SCENARIO_STATE")
    assert StatePaths.find().state.name == "scenario"
    with pytest.raises(OSError, match="the home directory in ~nobody9/state is unknown"):
        StatePaths.find(Path("~nobody9/state"))


def test_the_endpoint_is_argument_environment_contact_default(tmp_path, monkeypatch):
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path))
    places = StatePaths(tmp_path)
    assert find_endpoint() == Endpoint(places.endpoint, "default")
    places.contact_file.write_text("{half")
    assert places.read_contact() is None
    contact = DaemonContact("tcp/127.0.0.1:1234", 1, "0", 0.0)
    write_atomically(places.contact_file, codec.to_json(contact))
    assert find_endpoint().address == "tcp/127.0.0.1:1234"
    monkeypatch.setenv("SCENARIO_CONNECT", "tcp/h:1")
    assert find_endpoint().origin == "SCENARIO_CONNECT"
    assert find_endpoint("tcp/h:2").origin == "--connect"


@pytest.mark.parametrize(
    ("few", "fewer", "words"),
    [
        ({"f_bavail": 3}, {"f_bavail": 2}, "until 32 MiB are free"),
        ({"f_favail": 3}, {"f_favail": 2}, r"until 1000 files (inodes) are free"),
        ({"f_bavail": 3, "f_favail": 3}, {"f_favail": 2}, "until 32 MiB and 1000 files"),
    ],
)
def test_a_full_disk_is_said_before_runs_start(tmp_path, monkeypatch, few, fewer, words):
    places = StatePaths.find(tmp_path)
    assert places.disk_shortage() == ""
    disk = {"f_bavail": 2**30, "f_frsize": 4096, "f_files": 2**20, "f_favail": 2**19}
    monkeypatch.setattr(os, "statvfs", lambda _: SimpleNamespace(**disk))
    assert places.disk_shortage() == ""
    disk |= few
    said = places.disk_shortage()
    assert f"is full: runs wait {words}" in said
    disk |= fewer
    assert places.disk_shortage() == said  # whoever watches is told once
    disk |= {"f_bavail": 2**30, "f_files": 0, "f_favail": 0}
    assert places.disk_shortage() == ""  # no such table


def test_a_state_directory_that_is_gone_is_said(tmp_path):
    assert "cannot be used" in StatePaths.find(tmp_path / "gone").disk_shortage()


def test_sizes_are_read_as_they_are_written():
    assert [parse_size(text) for text in ("20GiB", "1.5 kB", " 7 B ")] == [20 * 2**30, 1500, 7]
    assert size_text(parse_size("1.5GiB")) == "1.5 GiB"
    for wrong in ("", "20", "GiB", "-1B", "1e9B", "20 parsecs"):
        with pytest.raises(ValueError, match="is not a size"):
            parse_size(wrong)


def test_a_quota_that_is_no_size_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv(QUOTA_VARIABLE, "20")
    with pytest.raises(DaemonError, match="the quota of traces: '20' is not a size"):
        ensure_daemon(tmp_path / "state")
