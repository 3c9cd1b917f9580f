"""The navigation packages of published robots, loaded from their launch files and driven.

Here are only descriptions of the robots and what to start; the packages themselves are looked for
below the folder that ``SCENARIO_REFERENCE_DATA`` names.
"""
