"""KTX 2.0 files: cube with MIP levels, VK_FORMAT_R16G16B16A16_SFLOAT, no supercompression."""

from __future__ import annotations

import struct

from rsibr.publishing.cube_levels import CubeLevels
from rsibr.publishing.published_view import MAKER

_IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
_RGBA16F = 97
_TEXEL, _CHANNEL_BITS = 8, 16
_ALIGNMENT = 8  # the texel's bytes, a multiple of 4
_HEADER = 80  # identifier, header and index
_RGBSDA, _BT709, _LINEAR = 1, 1, 1
_ALPHA = 15
_FLOAT_AND_SIGNED = 0xC0
_ONE, _MINUS_ONE = 0x3F800000, 0xBF800000


def encode_ktx2(cube: CubeLevels, about: str) -> bytes:
    """Bytes of the file: the smallest level first, in each the faces +X, −X, +Y, −Y, +Z, −Z.

    Parameters
    ----------
    cube : CubeLevels
        The levels.
    about : str
        Value of the key `rsibr`.

    Notes
    -----
    Khronos, *KTX File Format Specification*, version 2.0: header and index (section 3), levels (3.9.7 and 3.9.8),
    key/value data (3.11), and the basic data format descriptor of *Khronos Data Format* 1.3, section 5.
    """
    count = len(cube.levels)
    descriptor, keys = _descriptor(), _key_values(about)
    descriptor_at = _HEADER + 24 * count
    keys_at = descriptor_at + len(descriptor)
    head = struct.pack("<9I", _RGBA16F, 2, cube.size, cube.size, 0, 0, 6, count, 0)
    head += struct.pack("<4I2Q", descriptor_at, len(descriptor), keys_at, len(keys), 0, 0)
    parts = [level.astype("<f2").tobytes() for level in cube.levels]
    places: list[int] = []
    body = b""
    for part in reversed(parts):
        start = keys_at + len(keys) + len(body)
        body += bytes(-start % _ALIGNMENT)
        places.insert(0, keys_at + len(keys) + len(body))
        body += part
    index = b"".join(struct.pack("<3Q", at, len(part), len(part)) for at, part in zip(places, parts, strict=True))
    return _IDENTIFIER + head + index + descriptor + keys + body


def _descriptor() -> bytes:
    """Basic data format descriptor of four float16 channels, linear BT.709, straight alpha."""
    samples = b"".join(
        struct.pack(
            "<HBB4BII",
            channel * _CHANNEL_BITS,
            _CHANNEL_BITS - 1,
            kind | _FLOAT_AND_SIGNED,
            0,
            0,
            0,
            0,
            _MINUS_ONE,
            _ONE,
        )
        for channel, kind in enumerate((0, 1, 2, _ALPHA))
    )
    size = 24 + len(samples)
    block = struct.pack("<IHH4B4B8B", 0, 2, size, _RGBSDA, _BT709, _LINEAR, 0, 0, 0, 0, 0, _TEXEL, *[0] * 7)
    return struct.pack("<I", 4 + size) + block + samples


def _key_values(about: str) -> bytes:
    """Key/value data, keys in the order of their code points; each entry padded to four bytes."""
    values = {"KTXorientation": "rd", "KTXwriter": MAKER, "rsibr": about}
    entries = [f"{key}\0{value}\0".encode() for key, value in sorted(values.items())]
    return b"".join(struct.pack("<I", len(one)) + one + bytes(-len(one) % 4) for one in entries)
