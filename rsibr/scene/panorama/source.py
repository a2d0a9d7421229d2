"""Opening of a file that a user names: only regular files are opened, and none is waited for."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from rsibr.errors import InputError
from rsibr.regular_file import NotRegularError, open_regular

EXR_MAGIC = b"\x76\x2f\x31\x01"
RADIANCE_MAGIC = b"#?"

_CONVERT = "convert it to OpenEXR or Radiance HDR"
_HEAD = 4096

_FORMATS = (
    (b"\x89PNG", "a PNG"),
    (b"\xff\xd8\xff", "a JPEG"),
    (b"II*\0", "a TIFF"),
    (b"MM\0*", "a TIFF"),
    (b"II+\0", "a TIFF"),
    (b"MM\0+", "a TIFF"),
    (b"GIF8", "a GIF"),
    (b"BM", "a BMP"),
    (b"8BPS", "a Photoshop document"),
    (b"DDS ", "a DDS texture"),
    (b"\xabKTX", "a KTX texture"),
    (b"PF\n", "a PFM"),
    (b"Pf\n", "a PFM"),
    (b"SDPX", "a DPX"),
    (b"XPDS", "a DPX"),
    (b"\x01\xda", "an SGI picture"),
    (b"\0\0\0\x0cjP  ", "a JPEG 2000"),
    (b"\xff\x0a", "a JPEG XL"),
    (b"\0\0\0\x0cJXL ", "a JPEG XL"),
    (b"\x1f\x8b", "compressed with gzip"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"BZh", "compressed with bzip2"),
    (b"\xfd7zXZ", "compressed with xz"),
    (b"\x28\xb5\x2f\xfd", "compressed with Zstandard"),
    (b"7z\xbc\xaf", "a 7-Zip archive"),
    (b"version https://git-lfs", "a pointer of Git LFS, not the file itself"),
    (b"<", "text (HTML or XML)"),
)


def opened(path: Path) -> BinaryIO:
    """Open an environment file for reading.

    Parameters
    ----------
    path : Path
        The file; symbolic links are followed.

    Raises
    ------
    InputError
        If there is none, it cannot be read, or it is no regular file; see `rsibr.regular_file.open_regular`.
    """
    where = str(path)
    try:
        return open_regular(path)
    except NotRegularError as error:
        fix = "name an OpenEXR or Radiance HDR file"
        raise InputError(str(error.strerror), where=where, fix=fix) from None
    except FileNotFoundError:
        raise InputError("there is no such environment map", where=where, fix="check the path") from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=where) from None
    except ValueError as error:  # a zero byte in the name
        raise InputError(f"cannot be read: {error}", where=where) from None


def is_exr(path: Path) -> bool:
    """Whether a file is OpenEXR; otherwise it is Radiance.

    Raises
    ------
    InputError
        If it is neither, or no regular file that can be read; the message names the format that it has.
    """
    with opened(path) as stream:
        try:
            head = stream.read(_HEAD) or b""
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", where=str(path)) from None
    if head.startswith((EXR_MAGIC, RADIANCE_MAGIC)):
        return head.startswith(EXR_MAGIC)
    raise InputError(_what_else(head), where=str(path), fix=_CONVERT if head else "get it again")


def _what_else(head: bytes) -> str:
    if not head:
        return "is empty"
    if EXR_MAGIC.startswith(head) or RADIANCE_MAGIC.startswith(head):
        return f"has only {len(head)} bytes"
    kind = next((name for magic, name in _FORMATS if head.lstrip().startswith(magic) or head.startswith(magic)), "")
    if head[:4] == b"RIFF" and head[8:12] == b"WEBP":
        kind = "a WebP"
    if head[4:8] == b"ftyp":
        kind = "an AVIF or HEIF"
    if not head.strip(b"\0"):
        return "holds zeros only"
    return f"is neither OpenEXR nor Radiance HDR{f': it is {kind}' if kind else ''}"
