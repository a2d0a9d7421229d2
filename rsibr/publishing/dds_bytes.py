"""DirectDraw Surface files: cube with MIP levels, DX10 header, R16G16B16A16_FLOAT."""

from __future__ import annotations

import struct

from rsibr.publishing.cube_levels import CubeLevels

_HEADER, _PIXEL_FORMAT = 124, 32
_CAPS, _HEIGHT, _WIDTH, _PITCH, _PIXELS, _MIPS = 0x1, 0x2, 0x4, 0x8, 0x1000, 0x20000
_FOURCC = 0x4
_COMPLEX, _TEXTURE, _HAS_MIPS = 0x8, 0x1000, 0x400000
_ALL_FACES = 0xFE00
_RGBA16F, _TEXTURE_2D, _IS_CUBE, _OPAQUE = 10, 3, 0x4, 3
_TEXEL = 8  # bytes


def encode_dds(cube: CubeLevels) -> bytes:
    """Bytes of the file: faces +X, −X, +Y, −Y, +Z, −Z, each with all its levels, the largest first.

    Notes
    -----
    Microsoft, *Programming guide for DDS*: DDS_HEADER, DDS_PIXELFORMAT, DDS_HEADER_DXT10. The pitch is that of the
    largest level.
    """
    flags = _CAPS | _HEIGHT | _WIDTH | _PITCH | _PIXELS | _MIPS
    caps = _COMPLEX | _TEXTURE | _HAS_MIPS
    size, count = cube.size, len(cube.levels)
    header = struct.pack("<7I44x", _HEADER, flags, size, size, size * _TEXEL, 0, count)
    header += struct.pack("<2I4s5I", _PIXEL_FORMAT, _FOURCC, b"DX10", 0, 0, 0, 0, 0)
    header += struct.pack("<5I", caps, _ALL_FACES, 0, 0, 0)
    header += struct.pack("<5I", _RGBA16F, _TEXTURE_2D, _IS_CUBE, 1, _OPAQUE)
    faces = [level[face].astype("<f2").tobytes() for face in range(6) for level in cube.levels]
    return b"DDS " + header + b"".join(faces)
