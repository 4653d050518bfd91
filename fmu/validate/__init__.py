"""Checks of anybody's FMU: archive, XML, semantic rules, symbols, and a run in a child process.

The entry is `fmu.validate.fmu_file.check_fmu`; `fmu.archives.archive` also serves importers that extract an FMU.
"""
