"""Systems described in files: TOML, SSP, a single FMU or a folder; and made into slaves with connections.

It imports slaves, systems and tables of inputs; automata are found by the name of their class.
"""
