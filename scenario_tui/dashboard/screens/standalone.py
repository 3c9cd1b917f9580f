"""Screens that work over the dashboard or in their own app."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.screen import Screen

from scenario_tui.dashboard.screens.dialogs import Help
from scenario_tui.dashboard.themes import ThemedApp


class StandaloneScreen(Screen[None]):
    """A screen with its own keys for help and for the way back."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("question_mark,f1", "keys", "Help", id="help", tooltip="Keys and signs"),
        Binding("escape", "leave", "Back", id="leave", tooltip="To the screen before"),
    ]

    def action_keys(self) -> None:
        """Show the keys."""
        self.app.push_screen(Help(self.app.screen))

    def action_leave(self) -> None:
        """Go back to the screen before, or leave the app without one."""
        if len(self.app.screen_stack) > 1:
            self.app.pop_screen()
        else:
            self.app.exit()


class StandaloneApp(ThemedApp):
    """An app with only a replay, a comparison or a live world."""

    TITLE = "scenario"
    CSS_PATH = ["../dashboard.tcss", "../playing.tcss"]  # noqa: RUF012
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("q", "quit", "Quit", id="quit", tooltip="Leave the program"),
        Binding("ctrl+c", "quit", "Quit", show=False, priority=True, id="quit-at-once",
                tooltip="Leave from anywhere"),
    ]  # fmt: skip

    def __init__(self, screen: Screen[None]) -> None:
        super().__init__()
        self._first = screen

    def get_default_screen(self) -> Screen[None]:
        """Return the only screen."""
        return self._first


def run_alone(screen: Screen[None]) -> int:
    """Show a screen until the user leaves it; return the exit code of the app."""
    app = StandaloneApp(screen)
    app.limit_to_terminal()
    app.run()
    return app.return_code or 0
