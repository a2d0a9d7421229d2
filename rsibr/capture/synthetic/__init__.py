"""Photographs of a scene that Mitsuba renders, to test captures against the truth that made them."""
