"""Values that travel: scene, behaviours, robot and mission, and the geometry they share.

What a language means ends up here, and everything else works with it: plain, frozen, equal by
content, the same in memory, in JSON and in a trace.
"""
