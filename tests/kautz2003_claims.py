"""The claims of Kautz et al. (2003) in figures, as tables; `python -m tests.kautz2003_claims`."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

import numpy as np

from rsibr import backend
from rsibr.lobes.band_factors import exponent_for, ggx, phong
from rsibr.methods.kautz2003 import claims
from rsibr.methods.kautz2003.box_factors import bias_for

SKIES = Path(__file__).parent.parent / "scenes" / "environments"
FACES, EXPONENTS, BIASES = (2, 4, 8, 16, 32), (10.0, 100.0, 225.0), (2.0, 4.0, 6.0, 8.0)
SIZES, ALPHAS = (64, 128, 256), (0.05, 0.1, 0.2, 0.3, 0.5)


def main() -> None:
    """Print the tables."""
    backend.use()
    lights = {file.stem: claims.environment_faces(file) for file in sorted(SKIES.glob("*.exr"))}
    rng = np.random.default_rng(5)
    suns = [claims.small_sun(claims.SIZE, d / np.linalg.norm(d)) for d in rng.normal(size=(8, 3))]
    _table("relRMSE of diffuse by coefficients from faces of F²", [f"F = {face}" for face in FACES])
    for name, faces in lights.items():
        _row(name, [claims.coefficients_error(faces, face) for face in FACES])
    _row("sun alone, worst of 8", [max(claims.coefficients_error(sun, face) for sun in suns) for face in FACES])
    _table("relRMSE of diffuse by nine coefficients", ["nine"])
    for name, faces in [*lights.items(), ("sun alone", suns[0])]:
        _row(name, [claims.diffuse_error(faces)])
    _table("relRMSE of the box filter, against Phong's", [f"N = {n:g}" for n in EXPONENTS])
    for name, faces in lights.items():
        _row(name, [claims.box_error(faces, n) for n in EXPONENTS])
    controls = [f"N = {n:g}" for n in EXPONENTS[:2]]
    _table("spread over turns of the cube, box and Phong", [*(f"b = {b:g}" for b in BIASES), *controls])
    for name, faces in lights.items():
        box = [claims.shift_variance(faces, b) for b in BIASES]
        _row(name, [*box, *(claims.shift_variance(faces, 0, exponent=n) for n in EXPONENTS[:2])])
    _table("step across borders, without and with the cure", [f"b = {b:g}{s}" for b in BIASES for s in ("", ", cured")])
    for name, faces in lights.items():
        _row(name, [claims.border_step(faces, b, borders=cure) for b in BIASES for cure in (False, True)])
    _table("bias b of a lobe, and what it errs by", [f"b at {size}²" for size in SIZES] + ["error", "N", "error of N"])
    for name, factors in [
        *((f"N = {n:g}", phong(n)) for n in (1.0, *EXPONENTS)),
        *((f"α = {a}", ggx(a)) for a in ALPHAS),
    ]:
        found = [bias_for(factors, size) for size in SIZES]
        _row(name, [*(bias for bias, _ in found), found[-1][1], *exponent_for(factors)], digits=3)


def _table(title: str, columns: list[str]) -> None:
    print(f"\n| {title} | " + " | ".join(columns) + " |\n|---|" + "---|" * len(columns))  # noqa: T201


def _row(name: str, values: list[float], digits: int = 2) -> None:
    print(f"| {name} | " + " | ".join(f"{value:.{digits}g}" for value in values) + " |", flush=True)  # noqa: T201


if __name__ == "__main__":
    start = perf_counter()
    main()
    print(f"\n{perf_counter() - start:.0f} s")  # noqa: T201
