"""Executors: where the jobs of a batch run, a file each, found by import."""
