"""A recording to read, runs of the demo campaign to execute, and what others plug in."""

from dataclasses import replace
from importlib.metadata import EntryPoint

import pytest

from daemon.campaign import expand, load_campaign
from daemon.model.spec import SutReference
from daemon.run import execute
from grammars.text import plugins
from tests.engine.trace.recordings import record
from tests.plugins import plug_in


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """A complete trace of twelve seconds: one full chunk of each kind and a short one."""
    path = tmp_path_factory.mktemp("trace") / "run.mcap"
    record(path)
    return path


class Runs:
    """The runs of a campaign, to be executed with changes."""

    def __init__(self, file):
        self.submission = expand(load_campaign(file))
        self.scene = self.submission.scenes[0]

    def spec(self, scenario="busy-house", kind=None, parameters=None, **changes):
        """The first run of a scenario; with a ``kind`` another system drives."""
        spec = next(s for s in self.submission.specs if s.scenario == scenario)
        if kind is not None:
            changes["sut"] = SutReference(kind, kind, parameters or {})
        return replace(spec, **changes)

    def execute(self, spec, path, **options):
        return execute(spec, self.scene, trace_path=path, **options)


@pytest.fixture(scope="session")
def runs(campaigns):
    """The runs of the demo campaign."""
    return Runs(campaigns / "demo" / "campaign.yaml")


@pytest.fixture
def plug(monkeypatch):
    """Drive runs of the kind "plugged" with a system of the test: ``plug(system)``."""

    def plugged(system):
        plug_in(monkeypatch, "plugged", lambda _: system)
        return system

    return plugged


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
