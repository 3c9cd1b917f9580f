"""Command line and terminal dashboard.

Importing it sees to it that the other packages of this project are found, and none in their place.
"""

from scenario_tui._own_packages import claim_names

claim_names()
