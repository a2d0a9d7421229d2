"""A bake of synthetic maps, as quick to make as it is to write; run as a script, writers of it that get killed.

    python synthetic.py hold PATH               takes the lock, says so, waits for its end
    python synthetic.py steps FOLDER COUNT      kills a writer before its 1st, 2nd, 3rd … change to the disk
    python synthetic.py moments FOLDER COUNT    kills writers of COUNT bakes at random moments, each three times

The script forks its victims, so that they start in a millisecond; nothing but their writing runs in them.
"""

from __future__ import annotations

import functools
import json
import os
import signal
import stat
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from rsibr.geometry.frame import view_frame
from rsibr.geometry.viewpoints import Viewpoints, from_directions
from rsibr.store.bake import BakeWriter
from rsibr.store.manifest import EnvironmentRecord, Manifest, MaterialRecord
from rsibr.store.map_file import MapFile

RESOLUTION = 8
SECONDS = 0.25
"""What a view is said to have taken: fixed, so that whole manifests can be compared byte by byte."""

MANY = 12
"""Views of the bakes that are killed at random moments."""

CHANGES = ("mkdir", "fsync", "replace", "unlink")
"""Calls by which a writer changes the disk for good; between two of them the directory does not change its state."""


COUNT = 4
"""Views of other bakes: the fewest that cover the sphere."""

TETRAHEDRON = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]


@functools.cache
def viewpoints(count: int) -> Viewpoints:
    """A tetrahedron, turned by chance, and further random views."""
    random = np.random.default_rng(count)
    points = np.concatenate([TETRAHEDRON @ Rotation.random(rng=random).as_matrix(), random.normal(size=(count - 4, 3))])
    return from_directions(points)


def directions(count: int) -> np.ndarray:
    return viewpoints(count).directions


def manifest(count: int = COUNT, samples: int = 64) -> Manifest:
    config = {
        "environment": {"file": "/city.exr"},
        "material": {"preset": "matte-lambert"},
        "views": {"file": "/views.json"},
        "map": {"resolution": RESOLUTION},
        "sampling": {"samples": samples, "seed": 0},
    }
    contents = {"environment": {"content": "ab" * 32}, "material": {"content": "cd" * 32}}
    return Manifest.planned(
        config=config,
        identity={"config": config, "variant": "llvm_ad_rgb", **contents},
        packages={"mitsuba": "3.9.1"},
        variant="llvm_ad_rgb",
        environment=EnvironmentRecord(name="city"),
        material=MaterialRecord(name="paint", warp="mirror"),
        resolution=RESOLUTION,
        directions=directions(count),
        triangles=viewpoints(count).triangles,
    )


def baked(count: int, index: int, resolution: int = RESOLUTION, samples: int = 64) -> MapFile:
    """Make the map of a view: a pure function of the bake and the view, as a real one is."""
    random = np.random.default_rng([samples, index])
    frame = view_frame(directions(count)[index])
    image, variance = random.gamma(0.3, 2.0, (2, resolution, resolution, 3)).astype(np.float32)
    coverage = np.ones((resolution, resolution), np.float32)
    return MapFile(frame[:, 2], frame, {"radiance": image}, variance, coverage)


def write(
    path: Path, count: int = COUNT, samples: int = 64, fresh: bool = False, views: int | None = None
) -> list[int]:
    """Bake what is pending, or the first `views` of it; return what was pending."""
    with BakeWriter.open(path, manifest(count, samples), fresh=fresh) as writer:
        pending = writer.pending
        for index in pending[:views]:
            writer.commit(index, baked(count, index, samples=samples), SECONDS)
    return pending


def content(path: Path) -> dict[str, bytes]:
    """Every file of a bake but its lock, byte by byte."""
    files = (file for file in path.rglob("*") if file.is_file() and file.name != ".lock")
    return {str(file.relative_to(path)): file.read_bytes() for file in files}


def hold(path: Path) -> None:
    with BakeWriter.open(path, manifest()):
        print("held", flush=True)  # noqa: T201
        sys.stdin.read()


def kill_at_steps(folder: Path, count: int) -> dict[str, int]:
    """Leave `folder`/1, 2, 3 …, each killed one change later than the one before; the last one survived.

    Where the folder `old` is there, each begins as a copy of that bake and is written with `fresh`.
    """
    for step in range(1, count):
        path = folder / str(step)
        if (folder / "old").exists():
            write_copy(folder / "old", path)
        victim = fork(lambda path=path, step=step: write_until(path, step, fresh=(folder / "old").exists()))
        if os.waitstatus_to_exitcode(os.waitpid(victim, 0)[1]) == 0:
            return {"steps": step}
    raise RuntimeError(f"the writer makes more than {count} changes")


def write_copy(source: Path, path: Path) -> None:
    for name, data in content(source).items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_bytes(data)


def write_until(path: Path, step: int, fresh: bool) -> None:
    """Write a bake, and die just before the given change to the disk; a file not yet synced loses its second half."""
    steps = iter(range(1, 10_000))
    sync = os.fsync

    def dying(real: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        if next(steps) == step:
            if real is sync and stat.S_ISREG(os.fstat(arguments[0]).st_mode):
                os.ftruncate(arguments[0], os.fstat(arguments[0]).st_size // 2)
            os.kill(os.getpid(), signal.SIGKILL)
        # What is not synced outlives the process, though not the machine: a real sync would only take time here.
        return None if real is sync else real(*arguments, **options)

    for name in CHANGES:
        setattr(os, name, functools.partial(dying, getattr(os, name)))
    write(path, fresh=fresh)


def kill_at_moments(folder: Path, count: int) -> dict[str, int]:
    """Leave `folder`/0, 1, 2 …, each written by three writers in turn, killed at random moments."""
    start = time.perf_counter()
    os.waitpid(fork(lambda: write(folder / "timed", MANY)), 0)
    took = time.perf_counter() - start
    delays = np.random.default_rng(2).uniform(0.0, 0.6, (count, 3)) * took
    killed = 0
    for bake, moments in enumerate(delays):
        for delay in moments:
            victim = fork(lambda bake=bake: write(folder / str(bake), MANY))
            time.sleep(delay)
            os.kill(victim, signal.SIGKILL)
            killed += os.waitstatus_to_exitcode(os.waitpid(victim, 0)[1]) == -signal.SIGKILL
    return {"killed": killed}


def fork(work: Callable[[], object]) -> int:
    """Run `work` in a child process, which ends with it; return the child's id."""
    child = os.fork()
    if child:
        return child
    try:
        work()
    except BaseException:
        sys.excepthook(*sys.exc_info())
        os._exit(1)
    os._exit(0)


if __name__ == "__main__":
    command, place, *rest = sys.argv[1:]
    if command == "hold":
        hold(Path(place))
    else:
        kill = {"steps": kill_at_steps, "moments": kill_at_moments}[command]
        print(json.dumps(kill(Path(place), int(rest[0]))))  # noqa: T201
