"""The readable engine, in Python: flow to the first event, location, jumps, the Zeno guard.

It runs what cannot be traced, and is one side of the agreement tests. It imports `declare`,
`record`, and the options and numbers of runs: `solver`, `scales`, `stop`.
"""
