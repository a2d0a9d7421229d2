"""Names of the faces of a cube. Imports nothing, so that configs can be checked without Mitsuba."""

FACES = ("px", "nx", "py", "ny", "pz", "nz")
"""In the order of the sheets: +X, −X, +Y, −Y, +Z, −Z."""
