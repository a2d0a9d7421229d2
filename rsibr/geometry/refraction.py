"""Refraction of directions at a plane interface with the normal +z, by Snell's law.

Arithmetic alone, so that it serves Dr.Jit and NumPy arrays alike: components along the interface go in and out, and the
caller takes the root of the squared height.
"""

from __future__ import annotations

from typing import Any


def refracted(x: Any, y: Any, eta: Any) -> tuple[Any, Any, Any]:
    """Direction inside a denser medium.

    Parameters
    ----------
    x, y : mi.Float or ndarray
        Components along the interface of a unit direction outside.
    eta : mi.Float or float
        Index of refraction inside over that outside, ≥ 1.

    Returns
    -------
    x, y : mi.Float or ndarray
        Components along the interface inside.
    height_squared : mi.Float or ndarray
        Square of the component along the normal, ≥ 1 − 1/η².

    Examples
    --------
    >>> x, _, height_squared = refracted(0.6, 0.0, 1.5)
    >>> round(x, 3), round(height_squared**0.5, 3)
    (0.4, 0.917)
    """
    return _with_height(x / eta, y / eta)


def emerging(x: Any, y: Any, eta: Any) -> tuple[Any, Any, Any]:
    """Direction outside the denser medium: the inverse of `refracted`.

    Returns
    -------
    x, y, height_squared : mi.Float or ndarray
        As of `refracted`; the squared height is negative in total internal reflection.
    """
    return _with_height(x * eta, y * eta)


def _with_height(x: Any, y: Any) -> tuple[Any, Any, Any]:
    return x, y, 1 - (x * x + y * y)
