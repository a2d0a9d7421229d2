"""The README's picture of the car: three bakes under one sky, glass path-traced.

make car                                                    # out/car/car.png
python scripts/car_picture.py --out out/car --resolution 240x135 --rays 4
"""

from __future__ import annotations

import argparse
from pathlib import Path

import rsibr
from rsibr.resources import configs

MATERIALS = {"body": "solid-red", "rubber": "plastic-rough", "metal": "metal-aluminium"}
"""Preset of each shape of `scenes/objects/car.xml` that is shaded from a bake."""


def main() -> None:
    """Bake what is missing, and render."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/car"))
    parser.add_argument("--resolution", default="960x540")
    parser.add_argument("--rays", type=int, default=64)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    bakes = {
        shape: rsibr.bake(
            configs() / "demo.toml", out=given.out / f"{shape}.rsibr", overrides=[f'material.preset="{preset}"']
        )
        for shape, preset in MATERIALS.items()
    }
    width, height = (int(side) for side in given.resolution.split("x"))
    scene, size = configs().parent / "scenes" / "objects" / "car.xml", (width, height)
    rsibr.render(scene, bakes, resolution=size, rays=given.rays, out=given.out / "car.png")


if __name__ == "__main__":
    main()
