"""All that ``scenario check`` finds of a campaign, whether or not it can be loaded."""

from daemon.campaign import examine
from grammars.text.diagnostics import InputError


def findings_of(path):
    """Return the errors that end the loading of a campaign, otherwise what is found of it."""
    try:
        return examine(path)[1]
    except InputError as error:
        return error.findings
