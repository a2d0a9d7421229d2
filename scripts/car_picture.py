"""The README's picture of the car: three bakes under one sky, glass path-traced.

make car                                                    # out/car/car.png
python scripts/car_picture.py --out out/car --resolution 240x135 --rays 4
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import rsibr
from rsibr.resources import scenes
from rsibr.store.bake import Bake

MATERIALS = {
    "body": {"preset": "solid-red"},
    "rubber": {
        "bsdf": {
            "type": "roughplastic",
            "distribution": "ggx",
            "alpha": 0.35,
            "diffuse_reflectance": {"type": "rgb", "value": [0.02, 0.02, 0.02]},
        }
    },
    "metal": {"preset": "rough-aluminium"},
}
"""Material of each shape of `scenes/objects/car.xml` that is shaded from a bake; glass is path-traced."""


def main() -> None:
    """Bake what is missing, and render."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/car"))
    parser.add_argument("--resolution", default="960x540")
    parser.add_argument("--rays", type=int, default=64)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    bakes = {shape: _baked(material, given.out / f"{shape}.rsibr") for shape, material in MATERIALS.items()}
    width, height = (int(side) for side in given.resolution.split("x"))
    scene, size = scenes() / "objects" / "car.xml", (width, height)
    rsibr.render(scene, bakes, resolution=size, rays=given.rays, out=given.out / "car.png")


def _baked(material: dict[str, Any], out: Path) -> Bake:
    sky = {"file": str(scenes() / "environments" / "city.exr")}
    rest = {"map": {"resolution": 160}, "sampling": {"samples": 256}}
    return rsibr.bake({"environment": sky, "material": material, **rest}, out=out)


if __name__ == "__main__":
    main()
