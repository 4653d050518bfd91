"""From C to shared libraries: a compiler, calls of it, and what was compiled kept in the user's cache.

It knows neither automata nor FMI, and imports only `hybrid_model.errors` and where the engine's files are.
"""
