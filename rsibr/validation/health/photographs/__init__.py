"""Judgement of each map of a capture by the others: exposure, orientation and pose."""
