"""How an FMU of anybody's is unpacked and loaded, one way for `cosim`, `validate` and `cosim.flow_functions`.

It imports `fmu.archives`, `fmu.standard` and fmpy; nothing here knows the exporter.
"""
