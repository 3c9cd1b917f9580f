"""The process that starts a stack, watches it, and leaves nothing of it.

Standard library only, imported relatively: it runs in a Python without our packages, as a package
of its own, so that it is small and starts at once.
"""
