"""Tiny real studies, each made once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rsibr.studies.runner import Study, study


def tables(sky: Path) -> dict[str, Any]:
    """Plastic under four coloured lights, small enough for seconds."""
    return {
        "base": {
            "environment": {"file": str(sky)},
            "material": {"preset": "glossy-plastic"},
            "map": {"resolution": 16},
            "sampling": {"samples": 16},
        },
        "method": ["cabral1999", "rsibr"],
        "sweep": [
            {"samples": [4, 16, 64]},
            {"method": ["cabral1999"], "warp": ["mesh-4x12"], "precision": ["float16"]},
        ],
        "judge": {"views": 2, "samples": 256, "repeats": 3, "frames": 10},
        "path_tracing": {"samples": [16, 64, 256], "pass_samples": 16},
    }


@pytest.fixture(scope="session")
def small(tmp_path_factory: pytest.TempPathFactory, asymmetric_environment: Path) -> Study:
    """Return a finished study."""
    return study(tables(asymmetric_environment), out=tmp_path_factory.mktemp("study"))


def zoo_tables(sky: Path) -> dict[str, Any]:
    """Two classes of material under four coloured lights, of which errors alone are measured."""
    return {
        "base": {"map": {"resolution": 16}, "sampling": {"samples": 16}, "effects": {"spectral": "off"}},
        "scenes": {
            "material": [
                {"class": "plastic", "preset": "glossy-plastic"},
                {"class": "metal", "name": "dull copper", "bsdf": {"type": "roughconductor", "alpha": 0.4}},
            ],
            "environment": [str(sky)],
        },
        "sweep": [{"method": ["cabral1999", "rsibr", "rsibr-fine"]}],
        "judge": {"views": 2, "samples": 64, "repeats": 3, "errors_only": True, "keep_bakes": False},
    }


@pytest.fixture(scope="session")
def zoo(tmp_path_factory: pytest.TempPathFactory, asymmetric_environment: Path) -> Study:
    """Return a finished study of errors by class of material."""
    return study(zoo_tables(asymmetric_environment), out=tmp_path_factory.mktemp("zoo"))
