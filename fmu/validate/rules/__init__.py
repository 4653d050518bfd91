"""What the standard asks of an FMU's files, one module a subject; each function returns findings.

It imports the description, the archive and the kinds of binaries; nothing here runs an FMU.
"""
