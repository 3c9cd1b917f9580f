"""Campaign files: from layers by name to run specifications."""

from daemon.campaign.expand import expand
from daemon.campaign.load import Campaign, Cell, check, examine, load_campaign

__all__ = ["Campaign", "Cell", "check", "examine", "expand", "load_campaign"]
