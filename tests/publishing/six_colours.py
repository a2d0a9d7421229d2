"""A sphere of six colours, one a face of the cube, each face with a mark that shows turns, mirrors and transposes.

The faces are those of Khronos and Microsoft, written down once more from their documents: with X right and Y up in a
face, px is (1, Y, −X), nx (−1, Y, X), py (X, 1, −Y), ny (X, −1, Y), pz (X, Y, 1), nz (−X, Y, −1).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.publishing.published_view import PublishedView

Array = np.ndarray

FACES: dict[str, Callable[[Array, Array], tuple[Array, Array, Array]]] = {
    "px": lambda x, y: (1 + 0 * x, y, -x),
    "nx": lambda x, y: (-1 + 0 * x, y, x),
    "py": lambda x, y: (x, 1 + 0 * x, -y),
    "ny": lambda x, y: (x, -1 + 0 * x, y),
    "pz": lambda x, y: (x, y, 1 + 0 * x),
    "nz": lambda x, y: (-x, y, -1 + 0 * x),
}

COLOURS = np.array(
    [[0.9, 0.1, 0.1], [0.1, 0.8, 0.8], [0.1, 0.9, 0.1], [0.8, 0.1, 0.8], [0.1, 0.1, 0.9], [0.8, 0.8, 0.1]]
)
MARKS = 0.05 * np.arange(1, 7)

LEFT, RIGHT, BOTTOM, TOP = 0.1, 0.5, 0.5, 0.9
"""The mark of a face: above, and a little to the right."""

MARK = (0.3, 0.7)
NO_MARKS = ((0.0, 0.0), (-0.3, 0.7), (0.3, -0.7), (-0.3, -0.7), (0.7, 0.3), (0.7, -0.3), (-0.7, 0.3), (-0.7, -0.3))
"""Places in a face: the mark's, and where it would be if the face were turned, mirrored or transposed."""

VIEW = np.array([1.0, 0.4, 0.2]) / np.linalg.norm([1.0, 0.4, 0.2])
"""The direction −v, where a map has no texels, keeps clear of all those places."""


def radiance(d: Array) -> Array:
    """Radiance in unit directions of shape (…, 3)."""
    axis = np.abs(d).argmax(axis=-1)
    along = np.take_along_axis(d, axis[..., None], axis=-1)[..., 0]
    face = 2 * axis + (along < 0)
    q = d / np.abs(along)[..., None]
    x = np.choose(face, [-q[..., 2], q[..., 2], q[..., 0], q[..., 0], q[..., 0], -q[..., 0]])
    y = np.choose(face, [q[..., 1], q[..., 1], -q[..., 2], q[..., 2], q[..., 1], q[..., 1]])
    marked = (x > LEFT) & (x < RIGHT) & (y > BOTTOM) & (y < TOP)
    return np.where(marked[..., None], MARKS[face][..., None], COLOURS[face])


def places() -> tuple[Array, Array]:
    """Unit directions of all places of all faces, shape (54, 3), and their radiance as a table says it."""
    directions, expected = [], []
    for k, face in enumerate(FACES.values()):
        for x, y in (MARK, *NO_MARKS):
            directions.append(face(np.array(x), np.array(y)))
            expected.append(np.full(3, MARKS[k]) if (x, y) == MARK else COLOURS[k])
    d = np.array(directions, float)
    return d / np.linalg.norm(d, axis=1, keepdims=True), np.array(expected)


def view(resolution: int = 192, name: str = "", scale: float = 1.0, stem: str = "six") -> PublishedView:
    """A view of a perfect mirror among the six colours, in two passes."""
    frame = view_frame(VIEW)
    centres = (np.arange(resolution) + 0.5) * 2 / resolution - 1
    x, y = np.meshgrid(centres, -centres)
    shrink = np.maximum(np.hypot(x, y), 1)  # a texel that the rim cuts: its point on the rim
    x, y = x / shrink, y / shrink
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    r = np.stack([2 * x * z, 2 * y * z, 2 * z * z - 1], axis=-1) @ frame.T
    coverage = texel_coverage(resolution).astype(np.float32)
    image = np.where(coverage[..., None] > 0, scale * radiance(r), 0).astype(np.float32)
    passes = {"diffuse": image / 4, "specular": image - image / 4}
    return PublishedView(stem, name, "a mirror under six colours", "a table", frame, image, coverage, passes)


def seen(read: Array, expected: Array, tolerance: float = 0.02) -> None:
    """Assert that what was read at the places is what the table says."""
    np.testing.assert_allclose(read, expected, atol=tolerance)


def at(image: Array, columns: Array, rows: Array) -> Array:
    """Texels nearest to places in texels, in which whole numbers are centres."""
    height, width = image.shape[:2]
    column = np.clip(np.rint(columns).astype(int), 0, width - 1)
    return image[np.clip(np.rint(rows).astype(int), 0, height - 1), column, :3]
