"""Languages: what people write, given meaning.

Text becomes typed models, models are composed by reference, and the result is one validated,
frozen :class:`grammars.model.scene.Scene`. This room imports no other room of the project.
"""
