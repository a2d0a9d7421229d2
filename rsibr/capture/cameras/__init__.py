"""Cameras of photographs: intrinsics and poses in the conventions of other programs."""
