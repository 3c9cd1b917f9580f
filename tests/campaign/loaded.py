"""Views of a campaign file: its runs, its cells, the findings of ``scenario check``."""

from daemon.campaign import examine, expand, load_campaign
from grammars.text.diagnostics import InputError


def runs(path):
    return expand(load_campaign(path)).specs


def cells(path):
    return {cell.name: cell for cell in load_campaign(path).cells}


def digests(path, scenario=""):
    return [run.digest for run in runs(path) if scenario in ("", run.scenario)]


def findings_of(path):
    """Return the errors that end the loading of a campaign, otherwise the findings about it."""
    try:
        return examine(path)[1]
    except InputError as error:
        return error.findings


def messages(path):
    """Return all findings as texts, without the folder of the campaign."""
    return [str(one).replace(f"{path.parent}/", "") for one in findings_of(path)]
