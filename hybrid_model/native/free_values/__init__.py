"""What the maps of an automaton read besides their argument: globals, closures, attributes, arrays, functions.

A trace freezes all that. `snapshots` says whether it is still what it was, so that a trace can be kept and used again;
`reading` follows what code names (`code_names`), `classes` and `objects` say what a value holds and `known` what never
changes; `watch` compares. It imports `declare`.
"""
