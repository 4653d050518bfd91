"""What an FMU says in XML: parsed safely, held against its schema, and the description as objects of both versions.

It imports `fmu.archives`, `fmu.standard` and the findings.
"""
