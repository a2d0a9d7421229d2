"""Validation of reconstructions against a path-traced reference: reference, metrics, novel views."""
