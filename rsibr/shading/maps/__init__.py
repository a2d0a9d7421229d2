"""Reconstructed maps of a picture on the device: their MIP levels, how surfaces index them, filters over a footprint."""
