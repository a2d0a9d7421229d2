"""A batch in one process: what it takes beyond its Mitsuba kernels and one set-up."""

from __future__ import annotations

import time

import pytest

import rsibr
from rsibr.baking import noise_pilot, view
from rsibr.baking.blocks import estimate
from rsibr.baking.remembered import in_this_process
from rsibr.resources import configs, scenes

MATERIALS = "solid-red", "metallic-silver", "glossy-plastic", "matte-lambert"
SKIES = "city", "courtyard", "studio"
TARGET = 1.15


@pytest.mark.benchmark(group="batch")
def test_a_batch_takes_little_beyond_its_kernels_and_one_set_up(benchmark, tmp_path, monkeypatch):
    """`extra_info.ratio`: processor time of 4 materials × 3 skies at 64² over that of kernels and one set-up; ≤ 1.15.

    Kernels: all threads of this process during `estimate`, which renders the samples of views and of their pilots. One
    set-up: what the first bake takes beside its kernels: loading, probes, fits, compilation, the light and its file.
    `beside`: processor seconds beside kernels of a bake whose sky and material are both known.
    """
    spent = [0.0]

    def counted(*arguments, **options):
        start = time.process_time()
        try:
            return estimate(*arguments, **options)
        finally:
            spent[0] += time.process_time() - start

    for room in (view, noise_pilot):
        monkeypatch.setattr(room, "estimate", counted)
    in_this_process.forget()
    beside: dict[tuple[str, str], float] = {}
    kernels: dict[tuple[str, str], float] = {}

    def batch():
        for sky in SKIES:
            for material in MATERIALS:
                start, before = time.process_time(), spent[0]
                rsibr.bake(
                    configs() / "demo.toml",
                    out=tmp_path / material / f"{sky}.rsibr",
                    lights=tmp_path / "lights",
                    overrides=[
                        f"material.preset={material}",
                        f"environment.file={scenes() / 'environments' / f'{sky}.exr'}",
                        "map.resolution=64",
                    ],
                )
                kernels[sky, material] = spent[0] - before
                beside[sky, material] = time.process_time() - start - kernels[sky, material]

    benchmark.pedantic(batch, rounds=1)
    rendered, set_up, other = sum(kernels.values()), next(iter(beside.values())), sum(beside.values())
    ratio = (rendered + other) / (rendered + set_up)
    known = [beside[sky, material] for sky in SKIES[1:] for material in MATERIALS[1:]]
    benchmark.extra_info.update(ratio=ratio, kernels=rendered, set_up=set_up, beside=sum(known) / len(known))
    print(  # noqa: T201
        f"\n4 materials × 3 skies at 64²: {rendered + other:.1f} processor s = {ratio:.2f} × (kernels {rendered:.1f} s + one "
        f"set-up {set_up:.1f} s), {TARGET} is wanted; a bake of known sky and material {sum(known) / len(known):.2f} s beside"
    )
    print({"/".join(key): f"{value:.2f}" for key, value in beside.items()})
