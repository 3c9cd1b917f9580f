"""The console for text of others: their signs are shown, our styles pass."""

import io

from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from grammars.text.terminal_text import printable_streams
from scenario_tui.terminal.printable_console import PrintableConsole
from tests.people.poison import NAME, WORD, assert_harmless

LOST = "\N{REPLACEMENT CHARACTER}"


def console():
    file = io.StringIO()
    return PrintableConsole(
        file=file, force_terminal=True, color_system="standard", width=60, _environ={}
    ), file


def test_styles_stay_where_they_were():
    shown, file = console()
    shown.print(Text.assemble(("a\x1bb", "bold"), ("\u202ec", "red")))
    assert file.getvalue() == f"\x1b[1ma{LOST}b\x1b[0m\x1b[31m{LOST}c\x1b[0m\n"


def test_names_are_no_markup_and_no_pictures():
    shown, file = console()
    shown.print("[bold]x[/bold] [link=http://x]y[/link] [/] :car:")
    assert file.getvalue() == "[bold]x[/bold] [link=http://x]y[/link] [/] :car:\n"


def test_whatever_it_stands_in():
    shown, file = console()
    table = Table(f"title{NAME}", caption=f"caption{NAME}")
    table.add_row(f"cell{NAME}", end_section=True)
    for renderable in (table, Panel(f"panel{NAME}", title=NAME), {NAME: [NAME]}, ValueError(NAME)):
        shown.print(renderable, soft_wrap=False)
    shown.rule(NAME)
    with Live(f"live{NAME}", console=shown, auto_refresh=False) as live, printable_streams():
        live.update(Text(f"moves{NAME}"), refresh=True)
        print(f"printed beside it{NAME}")
    assert WORD in assert_harmless(file.getvalue().encode())


def test_columns_stay_beside_each_other():
    shown, file = console()
    table = Table.grid(padding=(0, 1))
    table.add_row("a\x1b\u202eb", "next")
    table.add_row("abcd", "next")
    shown.print(table)
    first, second = file.getvalue().splitlines()
    assert (first.index("next"), first[:4]) == (second.index("next"), f"a{LOST}{LOST}b")
