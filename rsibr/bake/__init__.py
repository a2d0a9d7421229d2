"""Radiance sphere maps by direct lighting, and their store on disk."""

from rsibr.callable_room import make_callable

make_callable(__name__, "rsibr.study.budget", "bake")
