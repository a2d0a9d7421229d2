"""Holds a reconstruction against path-traced truth: reference, metrics, pictures, report."""

from rsibr.callable_room import make_callable

make_callable(__name__, "rsibr.validate.validation", "validate")
