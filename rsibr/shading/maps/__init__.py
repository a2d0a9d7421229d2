"""Reconstructed maps of a picture on the device: MIP levels, how surfaces index them, filters over a footprint."""
