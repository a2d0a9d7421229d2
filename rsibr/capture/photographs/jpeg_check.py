"""Damage of a JPEG file that its decoder can tell, and would otherwise show as grey or shifted blocks.

Most entropy-coded bytes carry no check: a flipped one that still decodes changes the picture and cannot be told.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator

_START, _END = b"\xff\xd8", b"\xff\xd9"
_SCAN = 0xDA
_COMPLAINTS = ("Corrupt JPEG data", "Premature end of JPEG", "Invalid SOS parameters", "Inconsistent progression")
"""Beginnings of the warnings of libjpeg, which decodes on; the first one of a picture goes to stderr."""


def is_jpeg(data: bytes) -> bool:
    """Whether a file begins as a JPEG."""
    return data.startswith(_START)


def is_cut_short(data: bytes) -> bool:
    """Whether the end marker of a JPEG is missing behind its first scan; that of a thumbnail in the header is none."""
    place = len(_START)
    while place + 4 <= len(data) and data[place] == 0xFF:
        if data[place + 1] == _SCAN:
            return data.find(_END, place) < 0
        if data[place + 1] == 0xFF:  # padding before a marker
            place += 1
            continue
        place += 2 + int.from_bytes(data[place + 2 : place + 4], "big")
    return True


@contextlib.contextmanager
def complaints() -> Iterator[list[str]]:
    """Collect what a decoder in C writes to stderr meanwhile: the list is filled at the end.

    What else was written goes to stderr afterwards.
    """
    found: list[str] = []
    try:
        kept = os.dup(2)
    except OSError:  # closed: nothing can be heard
        yield found
        return
    with tempfile.TemporaryFile() as heard:
        try:
            os.dup2(heard.fileno(), 2)
            yield found
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            heard.seek(0)
            for line in heard.read().splitlines(keepends=True):
                text = line.decode("utf-8", "replace").strip()
                if text.startswith(_COMPLAINTS):
                    found.append(text)
                else:
                    os.write(2, line)
