"""Systems in the scenarios of mosaik, which brings simulators in other processes and on other machines together.

It imports systems and masters' start, and mosaik's API (the extra `mosaik`), which nothing else does.
"""
