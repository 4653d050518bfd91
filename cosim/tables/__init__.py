"""Tables of numbers over time: inputs of a run, its rows as they come, comparison with a reference, a picture.

It imports results, systems, and what masters call inputs.
"""
