"""Campaigns and systems under test as they are loaded, and the findings about them."""

from daemon.campaign import LayerLibrary, LayerReference, examine, expand, load_campaign
from grammars.text.diagnostics import InputError, Severity, Where


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


def write_sut(folder, name, text):
    (folder / f"{name}.yaml").write_text(f"sut: {name}\n{text}")


def load_sut(folder, name, values=None):
    """Return a system under test as a campaign names it, and the warnings about it as texts."""
    library = LayerLibrary(folder)
    sut = library.sut(LayerReference(name, values or {}, Where("campaign.yaml", 1, 1)))
    assert all(one.severity is Severity.WARNING for one in library.warnings)
    return sut, [str(one).replace(f"{folder}/", "") for one in library.warnings]
