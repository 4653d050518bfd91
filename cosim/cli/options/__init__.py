"""What each command takes: its options, examples and defaults, in modules that import little.

So help and refusals of what was typed come at once; the modules of `cosim.cli` that run commands are imported later.
"""
