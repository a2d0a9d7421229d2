"""Errors by zone under the worst lamps, as a table: `python -m tests.worst_light [--pictures DIR] [--samples S] …`."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from rsibr import backend
from tests.worst_light.judged import METHODS, RESOLUTION, SAMPLES, TRUTH_SAMPLES, ByZone, Room, cases
from tests.worst_light.pictures import write_sheet
from tests.worst_light.scenes import SCENES

HEAD = """\
| scene | view | material | method | relMSE inner | middle | rim | energy inner | middle | rim | brightest | holes |
|---|---|---|---|---|---|---|---|---|---|---|---|"""


def main() -> None:
    """Print the table, and write the pictures where they are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=Path, help="folder for a sheet of pictures of each view")
    parser.add_argument("--resolution", type=int, default=RESOLUTION, help="texels a side")
    parser.add_argument("--samples", type=int, default=SAMPLES, help="samples a texel of the stored maps")
    parser.add_argument("--truth-samples", type=int, default=TRUTH_SAMPLES, help="samples a texel of the truth")
    given = parser.parse_args()
    backend.use()
    sizes = {"resolution": given.resolution, "samples": given.samples, "truth_samples": given.truth_samples}
    with tempfile.TemporaryDirectory() as folder:
        room = Room(Path(folder), **sizes)
        print(HEAD)  # noqa: T201
        for scene, name, material in cases():
            lit, view = room.lit(scene, material), SCENES[scene].views[name]
            for method in METHODS:
                print(row([scene, name, material, method], lit.errors(method, view)), flush=True)  # noqa: T201
            if given.pictures:
                write_sheet(given.pictures / f"{scene}, {name}, {material}.png", lit, view)


def row(names: list[str], found: ByZone) -> str:
    """One row of the table."""
    errors = [f"{e.value:.2g} ± {e.ci95[1] - e.value:.1g}" for e in found.rel_mse.values()]
    energies = [f"{e.value:.3f} ± {e.ci95[1] - e.value:.3f}" for e in found.energy.values()]
    return "| " + " | ".join([*names, *errors, *energies, f"{found.brightest:.2f}", f"{found.holes:.2%}"]) + " |"


if __name__ == "__main__":
    main()
