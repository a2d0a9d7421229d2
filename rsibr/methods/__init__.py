"""Reconstruction methods: each computes the radiance of any normal and view from a bake, behind one protocol.

A method is one file below this folder, or a module of another package that is named by an entry point of the group
`rsibr.methods`; see `registry.py`.
"""

from rsibr.methods.protocol import Cost, Method, Needs, PointwiseMethod
from rsibr.methods.registry import register

__all__ = ["Cost", "Method", "Needs", "PointwiseMethod", "register"]
