"""Accuracy against time: sweeps over what a bake can spend on, their fronts, and what twice the time buys."""

from rsibr.callable_room import make_callable

make_callable(__name__, "rsibr.study.runner", "study")
