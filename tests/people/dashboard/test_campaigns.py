"""The first screen: beside or below the campaigns the one under the cursor."""

from dataclasses import replace

from tests.people.dashboard.driven import until
from tests.people.dashboard.inline import make_dashboard, press, screen_text, settle
from tests.people.fake import CAMPAIGN, NOW, FakeDaemon


class Nightly(FakeDaemon):
    """Has an earlier campaign of the same name, in which half of the runs failed."""

    def _campaign_rows(self):
        first, nightly = super()._campaign_rows()
        before = replace(nightly, id="nightly-0", passed=2, failed=2, submitted_at=NOW - 2e5)
        return first, nightly, before


async def test_beside_the_table_stands_the_campaign_under_the_cursor():
    async with make_dashboard(Nightly()).run_test(size=(120, 40)) as pilot:
        await settle(pilot)
        text = "\n".join(screen_text(pilot))
        assert "first  ✗ 2 unexpected" in text
        assert "S2  ✗✗▶…∅ !" in text
        assert "✗ S2/pilot/1  !" in text
        assert "no-contact: −0.12 m at 512.2 s" in text
        assert pilot.app.screen.about == CAMPAIGN
        await press(pilot, "j")
        text = "\n".join(screen_text(pilot))
        assert "50 % → 100 % passed, 2" in text
        assert "last failures" not in text


async def test_where_there_is_room_for_the_table_alone_nothing_more_is_judged():
    async with make_dashboard(FakeDaemon()).run_test(size=(80, 15)) as pilot:
        await settle(pilot)
        assert "last failures" not in "\n".join(screen_text(pilot))
        assert pilot.app.screen.about == ""
        await pilot.resize_terminal(80, 24)
        await until(pilot, lambda: "last failures" in "\n".join(screen_text(pilot)))
        lines = screen_text(pilot)
        below = next(number for number, line in enumerate(lines) if "last failures" in line)
        assert below > next(number for number, line in enumerate(lines) if CAMPAIGN in line)
