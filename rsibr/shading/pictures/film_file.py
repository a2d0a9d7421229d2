"""Film of numbered PNG files, by ffmpeg."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rsibr.errors import MachineError
from rsibr.store.atomic import write_atomic

FRAMES_PER_SECOND = 24


def check_ffmpeg() -> str:
    """Path of ffmpeg.

    Raises
    ------
    MachineError
        If there is none.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        fix = "install ffmpeg, or write numbered files, as in --out film_####.png"
        raise MachineError("a film needs ffmpeg, which is not on the PATH", where="out", fix=fix)
    return found


def write_film(frames: Sequence[Path], film: Path) -> None:
    """Write a film (MP4, H.264) of 24 frames a second, atomically.

    Parameters
    ----------
    frames : sequence of Path
        PNG files in one folder, named 000001.png and so on.
    film : Path
        File to write.

    Raises
    ------
    MachineError
        If there is no ffmpeg, or it fails.
    """
    pattern = str(frames[0].with_name("%06d.png")).replace("%06d", "\0").replace("%", "%%").replace("\0", "%06d")
    with tempfile.TemporaryDirectory(prefix=".film-", dir=frames[0].parent) as folder:
        made = Path(folder) / "film.mp4"
        command = [check_ffmpeg(), "-nostdin", "-loglevel", "error", "-y", "-framerate", str(FRAMES_PER_SECOND)]
        command += ["-start_number", "1", "-i", pattern, "-frames:v", str(len(frames))]
        # H.264 as players read it: even sides, 4:2:0, Rec.709
        command += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709", "-pix_fmt", "yuv420p"]
        command += ["-c:v", "libx264", "-crf", "16", "-colorspace", "bt709", "-movflags", "+faststart", str(made)]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if ended.returncode != 0 or not made.is_file():
            said = (ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"])[-1]
            raise MachineError(f"ffmpeg failed: {said}", where=str(film), fix="see that it has libx264")
        write_atomic(film, made.read_bytes())
