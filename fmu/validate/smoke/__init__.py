"""The smoke run: which experiments are made on an FMU, what each is told, and the child process that makes it.

It imports the description as read, `fmu.importer`, `fmu.standard`, and of `fmu.validate.child` what both sides of the
pipe must know.
"""
