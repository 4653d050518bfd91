"""An FMU behind a slave: its file, its scalars by name, access to their values, and what it says in calls.

It imports `fmu.importer`, `fmu.archives`, `fmu.standard`, and the terms of `cosim.slave`; slaves are made on it.
"""
