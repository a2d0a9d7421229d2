"""What only Mitsuba can tell of a batch is found before its first bake."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.batches.check import check_contents
from rsibr.batches.matrix import Matrix
from rsibr.batches.sections import canonical_text
from rsibr.errors import InputError
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import environment_digest
from rsibr.scene.material import material_digest
from tests.batches.files import batch
from tests.scene.maps import write_exr

AXES = {"material": ["solid-red", {"file": "materials/*.xml"}], "environment": ["skies/*.exr"]}


def checked(folder, **tables):
    matrix, steps = Matrix.of(batch(folder, **tables)), []
    matrix.check()
    return matrix, check_contents(matrix, steps.append), steps


def test_each_material_and_sky_is_loaded_once_and_its_digest_known(folder):
    matrix, contents, steps = checked(folder, matrix={**AXES, "sampling.seed": [1, 2, 3]})
    assert [step.done for step in steps] == [1, 2, 3, 4, 5]
    for job in matrix.jobs():
        material, environment = job.settings["material"], job.settings["environment"]
        assert contents["material"][canonical_text(material)] == material_digest(MaterialConfig(**material))
        found = contents["environment"][canonical_text(environment)]
        assert found == environment_digest(EnvironmentConfig(**environment))


def test_all_mistakes_are_told_at_once(tmp_path):
    (tmp_path / "glass.xml").write_text('<bsdf version="3.0.0" type="dielectric"/>')
    (tmp_path / "typo.xml").write_text('<bsdf version="3.0.0" type="difuse"/>')
    spoilt = np.full((4, 8, 3), 0.5)
    spoilt[1, 2, 0] = np.nan
    write_exr(tmp_path / "spoilt.exr", spoilt)
    axes = {
        "material": [{"file": "*.xml"}, "solid-red"],
        "environment": ["spoilt.exr", {"emitter": {"type": "point"}, "name": "lamp"}],
    }
    with pytest.raises(InputError) as refused:
        checked(tmp_path, matrix=axes)
    told = str(refused.value)
    assert "'glass' lets light through" in told
    assert "typo.xml" in told
    assert 'Plugin "difuse" not found' in told
    assert "texel (row 1, column 2) is NaN in channel R" in told
    assert "is no emitter at infinity" in told
    assert "\n" not in told


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        ({"then": {"validate": {"methods": ["rsib"]}}}, "then.validate.methods: "),
        ({"then": {"publish": ["latlon"]}}, "then.publish: "),
        ({"matrix": {"methods.rsibr.nothing": [3]}}, "nothing"),
        ({"matrix": {"plugins.modules": [["no_such_module_of_plugins"]]}}, "no_such_module_of_plugins"),
        ({"matrix": {"views.file": ["views.json"]}}, "cover"),
    ],
)
def test_a_mistake_is_one_clear_line(tmp_path, tables, says):
    (tmp_path / "views.json").write_text('{"directions": [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]}')
    with pytest.raises(InputError) as refused:
        checked(tmp_path, **{"matrix": {"sampling.seed": [1]}, "name": "job", **tables})
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)
