"""A method of a user's own, which reads nothing of a bake."""

import drjit as dr
import mitsuba as mi

from rsibr.methods.protocol import PointwiseMethod


class Grey(PointwiseMethod):
    """One grey for every surface and view."""

    def __init__(self, inputs, *, value=0.5):
        super().__init__(inputs)
        self.value = mi.Float(value)
        dr.make_opaque(self.value)

    def eval(self, n, v):
        return mi.Color3f(self.value)
