"""FMUs of both versions and both kinds driven by their plain C functions, with no wrapper of anybody else's in between.

`binary` loads an FMU, `component` is one instance of it; `calls` knows every function and when it may be called;
`runs`, `exchange` and `journey` are the ways in which importers run an FMU.
"""
