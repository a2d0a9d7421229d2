"""Batches: a matrix of bakes, run on one machine or many, with an index and a gallery."""
