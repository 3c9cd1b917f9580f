"""Every command there is, with the words that call it."""

from scenario_tui.cli.commands import COMMANDS, load_command


def commands():
    """Yield the words that call a command, and the command."""

    def walk(command, words):
        inner = getattr(command, "commands", None)
        if inner is None:
            yield " ".join(words), command
        for name, one in (inner or {}).items():
            yield from walk(one, (*words, name))

    for name in COMMANDS:
        yield from walk(load_command(name), (name,))
