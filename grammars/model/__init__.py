"""Value types: scene, behaviours, robot, mission, and the geometry they share.

All languages are compiled into these frozen dataclasses, which are compared by content and are the
same in memory, in JSON and in traces.
"""
