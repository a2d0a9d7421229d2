"""Methods on a config alone: nothing is baked, and the result is that of the bake."""

import numpy as np
import pytest

import rsibr
from rsibr.errors import BakeError
from rsibr.methods.method_set import MethodSet
from rsibr.methods.unbaked import unbaked

MAPLESS = ("miller1984", "kautz2003", "split-sum")


def test_a_config_serves_methods_that_read_no_maps_as_its_bake_does(small_bakes):
    bake = small_bakes("rough-aluminium")
    alone, baked = MethodSet(unbaked(bake.config)), MethodSet(bake)
    assert tuple(alone) == MAPLESS
    for name in MAPLESS:
        frame = np.eye(3)
        assert np.array_equal(alone[name].map(frame, 24).numpy(), baked[name].map(frame, 24).numpy())
        assert not alone[name].cost.reads_maps
        assert alone[name].cost.bytes == 0
        assert alone[name].cost.bake_seconds > 0  # probes and fits


@pytest.mark.parametrize("name", ["rsibr", "cabral1999"])
def test_a_method_that_reads_maps_is_refused(small_bakes, name):
    with pytest.raises(BakeError, match=f"it is not baked, and '{name}' reads stored maps.*use one of: miller1984"):
        MethodSet(unbaked(small_bakes("rough-aluminium").config))[name]


def test_the_path_of_a_config_is_reconstructed_from(tmp_path):
    path = tmp_path / "matte.toml"
    path.write_text(
        '[environment]\nemitter = {type = "constant"}\n[material]\npreset = "matte-lambert"\n[map]\nresolution = 16\n'
    )
    made = rsibr.reconstruct(path, (1, 2, 3), method="kautz2003")
    assert made.image.shape == (16, 16, 3)
    lit = made.image[made.coverage == 1]
    assert np.allclose(lit, lit[0], rtol=0.01)  # a constant sky
    assert not list(tmp_path.glob("*.rsibr"))
