"""Curve of a sensor that stores its signal as it is."""

from __future__ import annotations

from rsibr.capture.curves.curve import Curve, register

LINEAR = register(Curve.of("linear", lambda value: value))
"""Values proportional to exposure: 16-bit TIFF that was developed from raw."""
