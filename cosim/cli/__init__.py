"""The command line: the only place that imports hybrid_model, fmu and cosim together."""
