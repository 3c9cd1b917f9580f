"""Searches of campaign files as cases, unchecked."""

from daemon.campaign import load_campaign
from daemon.search.composition import search_case


def load_search_case(file, name):
    """Load a campaign and one of its searches."""
    campaign = load_campaign(file)
    (task,) = (task for task in campaign.searches if task.name == name)
    return search_case(campaign, task)
