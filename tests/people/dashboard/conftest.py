"""Fixtures of the dashboard's tests."""

import pytest

from tests.people.dashboard.dash import opened_apps


@pytest.fixture
async def dashboard(fake):
    """Open a dashboard, or another app: ``dash = await dashboard()``.

    By default it is that of ``fake``, in 80 x 24 cells; it has taken over what there is. It shows
    the ``run`` that is named. If not ``settled``, something is still under way in it.
    """
    async with opened_apps() as open_app:

        async def open_it(what=None, size=(80, 24), run="", settled=True, **settings):
            dash = await open_app(fake if what is None else what, size, settled, **settings)
            if run:
                await dash.open("run", run)
            return dash

        yield open_it
