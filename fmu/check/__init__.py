"""Checks of anybody's FMU: archive, XML, semantic rules, symbols, and a run in a child process.

The entry is `fmu.check.fmu_file.check_fmu`; `fmu.check.archive` also serves importers that extract an FMU.
"""
