"""Large compositions as loops over tables: parts with equal maps share one traced function.

It imports `declare` and the tracing of `native`.
"""
