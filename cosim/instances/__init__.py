"""One instance of anybody's FMU: its file, its functions in both versions of the standard, access to its values.

It imports `fmu.importer` and `fmu.archives`; slaves are made on it.
"""
