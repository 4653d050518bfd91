"""Co-simulation: slaves (FMUs and automata behind one interface) and the masters that run them together.

It imports `hybrid_model`, and of `fmu` the rooms that know nothing of the exporter.
"""
