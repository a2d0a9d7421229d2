"""Lamps: lights of known energy in a latitude–longitude map."""
