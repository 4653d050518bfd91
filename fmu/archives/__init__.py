"""The ZIP archive of an FMU: what is checked (`checks`), read and extracted (`reading`), and written (`writing`).

For `cosim`, `validate` and the exporter alike; it imports `fmu.errors` and the standard library.
"""
