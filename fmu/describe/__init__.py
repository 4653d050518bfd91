"""What an FMU says of itself: its variables, its XML for each version of the standard, units, terminals, documentation.

It imports `hybrid_model`, `fmu.archives` and `fmu.standard`; nothing here compiles.
"""
