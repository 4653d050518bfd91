"""How an FMU of anybody's is unpacked and loaded, one way for `cosim`, `validate` and `cosim.flow_functions`.

Nothing here knows the exporter. `fmu.importer.callbacks` and `fmu.importer.unpacking` need the standard library only.
"""
