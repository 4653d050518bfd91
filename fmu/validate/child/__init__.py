"""What runs in the child process: standard library only, so that it starts fast and holds little that can break.

Of the project it imports `fmu.standard` and `fmu.importer.memory`.
"""
