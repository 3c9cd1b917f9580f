"""Files with mistakes nobody thought of: mutated inputs of every language, answered or refused.

``make fuzz``, or ``python -m tests.languages.fuzz -n 10000 scenery oracles``. What a run finds is
kept in ``corpus/LANGUAGE``, from where the tests read it ever after.
"""
