"""Signals and oracles of other people, plugged in for one test."""

from importlib.metadata import EntryPoint

import pytest

from grammars.text import plugins


@pytest.fixture
def plug_oracles(monkeypatch):
    """Install signals and oracles by their names: ``plug_oracles({"busy": "module:busy"}, {})``."""

    def plug(signals, oracles):
        entries = {
            group: {name: EntryPoint(name, value, group) for name, value in named.items()}
            for group, named in (("scenario.signals", signals), ("scenario.oracles", oracles))
        }
        plugins.load_plugin.cache_clear()
        monkeypatch.setattr(plugins, "installed", entries.__getitem__)

    yield plug
    plugins.load_plugin.cache_clear()
