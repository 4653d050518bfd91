"""From a traced automaton to the members of an archive: model.c, libraries for six platforms, sources, description.

It imports `fmu.describe`, `fmu.archives`, `fmu.standard` and `hybrid_model`.
"""
