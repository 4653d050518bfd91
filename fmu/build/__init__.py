"""From C code to an archive: model.c, libraries for six platforms, sources, and the file itself.

It imports `fmu.describe` and `hybrid_model`.
"""
