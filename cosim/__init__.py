"""Co-simulation: slaves (FMUs and automata behind one interface) and the masters that run them together."""
