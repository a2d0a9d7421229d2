"""Kind of an image file, by the ending of its name."""

from __future__ import annotations

import stat
from pathlib import Path

from rsibr.errors import InputError


def image_kind(path: Path | str, others: tuple[str, ...] = ()) -> str:
    """Kind of the image file that `path` is to become: `"exr"` or `"png"`, or one of `others`.

    Parameters
    ----------
    path : path
        File to write; upper case counts. A pipe or a device that exists, such as `/dev/null`, takes an EXR.
    others : tuple of str
        Further kinds that the caller writes.

    Raises
    ------
    InputError
        If the name has another ending, or none.

    Examples
    --------
    >>> image_kind("picture.PNG")
    'png'
    """
    suffix, known = Path(path).suffix.lower(), ("exr", "png", *others)
    if suffix[1:] in known:
        return suffix[1:]
    if not suffix and _is_special(Path(path)):
        return "exr"
    what = f"no image is written with the ending '{suffix}'" if suffix else "the name has no ending"
    names = ", ".join(f".{one}" for one in known)
    raise InputError(f"{path}: {what}", where="out", fix=f"name a file that ends in one of: {names}")


def _is_special(path: Path) -> bool:
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode)
