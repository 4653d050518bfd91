"""What the standard asks of an FMU's files, one module a subject; each function returns findings.

It imports `reading`, `binaries`, `fmu.archives` and `fmu.standard`, and asks fmpy as well; nothing here runs an FMU.
"""
