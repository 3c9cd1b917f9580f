"""Entry point of the pytest plug-in: its option, its fixture, and the files it collects.

pytest loads this module in every project that shares an environment with ours, so it imports
nothing else. :mod:`scenario_tui` takes four short names (``daemon``, ``campaigns``, …) for its own
packages: it is imported only where a test or a campaign file asks for it.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from scenario_tui.library.pytest_plugin import ScenarioRunner

_NAMED_FILES = pytest.StashKey[frozenset[Path]]()
_CAMPAIGN = re.compile(rb"^campaign\s*:", re.MULTILINE)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that names a daemon."""
    parser.getgroup("scenario").addoption(
        "--scenario-connect",
        metavar="ENDPOINT",
        default="",
        help="Daemon that executes the runs of campaigns (default: $SCENARIO_CONNECT, otherwise a"
        " private daemon whose results pytest's cache keeps).",
    )


@pytest.fixture
def scenario(request: pytest.FixtureRequest) -> ScenarioRunner:
    """Run one scenario of a campaign with one system and return its cell.

    ``scenario("campaigns/demo/campaign.yaml", "busy-house", sut="my-nav2")``: the file is relative
    to the root directory of pytest.
    """
    try:
        from scenario_tui.library.pytest_plugin import ScenarioPlugin, ScenarioRunner
    except ImportError as error:
        raise pytest.fail.Exception(str(error), pytrace=False) from None
    return ScenarioRunner(ScenarioPlugin.of(request.config), request.node)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect ``*.campaign.yaml``, files of ``[tool.scenario]``, and campaigns named one by one."""
    if file_path.suffix not in (".yaml", ".yml") or not _is_wanted(file_path, parent):
        return None
    try:
        from scenario_tui.library.pytest_plugin import CampaignCollector
    except ImportError as error:  # somebody else has a package of our names
        raise parent.CollectError(f"{file_path} cannot be loaded: {error}") from error
    return CampaignCollector.from_parent(parent, path=file_path)


def _is_wanted(path: Path, parent: pytest.Collector) -> bool:
    if path.name.endswith((".campaign.yaml", ".campaign.yml")) or path in _named(parent.config):
        return True
    # Other plug-ins collect YAML files, too.
    return parent.session.isinitpath(path) and bool(_CAMPAIGN.search(path.read_bytes()))


def _named(config: pytest.Config) -> frozenset[Path]:
    """Return the files that ``campaigns`` of ``[tool.scenario]`` in pyproject.toml names."""
    if _NAMED_FILES not in config.stash:
        config.stash[_NAMED_FILES] = frozenset(_read_named(config.rootpath))
    return config.stash[_NAMED_FILES]


def _read_named(root: Path) -> list[Path]:
    import tomllib

    file = root / "pyproject.toml"
    try:
        settings: Any = tomllib.loads(file.read_text("utf-8")) if file.is_file() else {}
    except ValueError as error:
        raise pytest.Collector.CollectError(f"{file}: {error}") from error
    patterns = settings.get("tool", {}).get("scenario", {}).get("campaigns", [])
    if not isinstance(patterns, list) or not all(isinstance(one, str) for one in patterns):
        raise pytest.Collector.CollectError(
            f'{file}: campaigns of [tool.scenario] is a list of paths: ["demo/campaign.yaml"]'
        )
    return [path for pattern in patterns for path in root.glob(pattern)]
