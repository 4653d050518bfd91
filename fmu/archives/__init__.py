"""Whether an archive may be unpacked, and which names a file may have: for `cosim`, `validate` and the exporter alike.

It imports nothing of the project.
"""
