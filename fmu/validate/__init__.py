"""Checks of anybody's FMU: archive, XML, semantic rules, symbols, and a run in a child process.

The entry is `fmu.validate.check.check_fmu`. It imports `fmu.archives`, `fmu.importer` and `fmu.standard`, never the
exporter: what checks an FMU shares no code with what makes one.
"""
