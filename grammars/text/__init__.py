"""Reading text: YAML with places, quantities with units, messages for people, JSON, syntax trees.

All languages and file formats read through these modules. None of them knows about scenes.
"""
