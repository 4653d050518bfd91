"""FMUs in processes of their own: one that crashes or hangs takes nothing else with it.

It imports the slaves that it puts there.
"""
