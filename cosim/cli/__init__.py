"""The command line: the only place of `cosim` that knows the exporter and `fmu.validate` too. It imports everything."""
