"""Any view's radiance from the stored ones: warps, blends and the methods made of them."""

from rsibr.callable_room import make_callable

make_callable(__name__, "rsibr.reconstruct.reconstruction", "reconstruct")
