"""Forecast of the memory that methods of a bake take."""

from __future__ import annotations

from rsibr.store.stored_maps import StoredMaps

OUTPUT_BYTES = 64
"""Memory for each texel of a reconstructed map: the kernel's results, the image and its coverage [bytes]."""


def maps_memory(bake: StoredMaps) -> int:
    """Memory of all stored maps, decoded and prepared for the default method [bytes].

    Notes
    -----
    A texel has 4 bytes for each decoded channel, and the RGBA of each lobe and of their sum on the device. Measured
    for two lobes: 95 bytes, where this gives 100.
    """
    lobes = max(1, len(bake.manifest.lobes))
    decoded, on_device, total = 4 * (3 * lobes + 4), 16 * (lobes + 1), 12
    return bake.view_count * bake.resolution**2 * (decoded + on_device + total)
