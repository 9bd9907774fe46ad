"""Compiled loops. Plain arrays and scalars in, results into ``out``; no validation, no objects.

Callers validate. Every kernel has a slow, obvious twin in ``tests/reference.py``.
Compiled code is cached on disk by Numba.
"""
