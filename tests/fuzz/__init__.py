"""Seeded fuzzing of everything that is read: ``python -m tests.fuzz --help``, or ``make fuzz``."""
