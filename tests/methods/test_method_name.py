"""Names with options, addresses of a user's own methods, and options from a bake's config."""

import pathlib
import re

import numpy as np
import pytest

import rsibr
from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.methods.method_name import file_stem, parse_name
from rsibr.methods.method_set import MethodSet
from rsibr.methods.registry import method_digest, method_names, registration
from rsibr.store.bake import Bake

FRAME = view_frame(np.array([0.6, 0.0, 0.8]))
PAGE = pathlib.Path(__file__).parents[2] / "docs" / "extend" / "method.md"


@pytest.fixture
def grey(tmp_path, monkeypatch):
    """The example of the documentation, in the user's working folder."""
    (code,) = re.findall(r'```python\n("""One grey.*?)```', PAGE.read_text(), re.DOTALL)
    (tmp_path / "toy_grey_example.py").write_text(code)
    monkeypatch.chdir(tmp_path)
    return "toy_grey_example:Grey"


@pytest.mark.parametrize(
    ("text", "name", "options"),
    [
        ("rsibr", "rsibr", {}),
        ("a,n=1.5,table=[1, 2],on=true", "a", {"n": 1.5, "table": [1, 2], "on": True}),
        ("a, lookup = nearest", "a", {"lookup": "nearest"}),
        ("a,word='x,y=z'", "a", None),  # a comma in quotes before a name and = cannot be told from the next option
    ],
)
def test_a_name_carries_options(text, name, options):
    if options is None:
        with pytest.raises(InputError):
            parse_name(text)
    else:
        assert parse_name(text) == (name, options)


def test_an_option_in_the_name_is_the_option_of_the_factory(small_bakes):
    methods = MethodSet(small_bakes("rough-aluminium"))
    named, plain = methods["cabral1999,weights=gnomonic"], methods.variant("cabral1999", weights="gnomonic")
    frame = FRAME
    assert named.name == "cabral1999,weights=gnomonic"
    assert np.array_equal(named.map(frame, 16).numpy(), plain.map(frame, 16).numpy())
    assert not np.array_equal(named.map(frame, 16).numpy(), methods["cabral1999"].map(frame, 16).numpy())
    assert method_digest("cabral1999,weights=gnomonic") != method_digest("cabral1999")
    assert not any("," in name for name in method_names())


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("cabral1999,wieghts=area", r"cabral1999 has no option 'wieghts'. Did you mean 'weights'\?"),
        ("nearest,n=1", "nearest has no option 'n'. It has none"),
        ("cabral1999,weights=area,weights=area", "option weights is given twice"),
        ("velvet,n=1", "unknown method 'velvet'"),
        ("toy_grey_example:Gray", "Gray in it does not exist. Did you mean 'Grey'"),
        ("toy_grey_example:__doc__", "__doc__ in it is not callable"),
        ("no_such_module:Grey", "there is no module 'no_such_module'"),
        ("no_such_file.py:Grey", "there is no file .*no_such_file.py"),
        (":Grey", "is no address of a method"),
    ],
)
def test_a_name_that_cannot_be_used_is_refused_in_one_line(grey, name, message):
    with pytest.raises(InputError, match=message):
        registration(name)


def test_the_documented_example_works_by_its_address(grey, small_bakes, tmp_path):
    bake = small_bakes("rough-aluminium")
    for name, value in ((grey, 0.5), (f"{grey},value=0.25", 0.25), (f"{tmp_path}/toy_grey_example.py:Grey", 0.5)):
        made = rsibr.reconstruct(bake, view=(1, 2, 3), method=name)
        assert made.method == name
        assert np.unique(made.image[made.coverage > 0]).tolist() == [value]
    assert registration(grey).summary == grey  # the class has no docstring
    names = [f"{grey},value=0.25", "cabral1999"]
    found = rsibr.validate(bake, views=1, methods=names, samples=16, out=tmp_path / "report")
    assert list(found.summary) == names
    pictures = {one.name for one in (tmp_path / "report" / "pictures").iterdir()}
    assert f"view_01_{file_stem(names[0])}.png" in pictures


def test_a_package_that_imports_its_own_modules_holds_a_method(grey, tmp_path):
    package = tmp_path / "toy_package"
    package.mkdir()
    (package / "helper.py").write_text("VALUE = 0.5")
    code = (tmp_path / "toy_grey_example.py").read_text()
    (package / "__init__.py").write_text("from . import helper\n" + code)
    assert registration("toy_package:Grey").options == {"value": 0.5}


def test_what_makes_no_method_is_refused(grey, small_bakes, tmp_path):
    (tmp_path / "toy_none.py").write_text("def make(inputs):\n    return 1\n")
    with pytest.raises(InputError, match="method toy_none:make: makes int, which is no method"):
        MethodSet(small_bakes("rough-aluminium"))["toy_none:make"]


def test_options_of_a_config_hold_for_its_bake_and_yield_to_the_name(small_bakes):
    bake = small_bakes("rough-aluminium")

    def configured(**options):
        config = {**bake.manifest.config, "methods": {"cabral1999": options}}
        return MethodSet(Bake(bake.path, bake.manifest.model_copy(update={"config": config})))

    plain, frame = MethodSet(bake), FRAME
    gnomonic = plain["cabral1999,weights=gnomonic"].map(frame, 16).numpy()
    area = plain["cabral1999"].map(frame, 16).numpy()
    methods = configured(weights="gnomonic")
    assert np.array_equal(methods["cabral1999"].map(frame, 16).numpy(), gnomonic)
    assert np.array_equal(methods["cabral1999,weights=area"].map(frame, 16).numpy(), area)
    with pytest.raises(InputError, match=r"methods.cabral1999: cabral1999 has no option 'wieghts'"):
        configured(wieghts="area")["cabral1999"]


def test_a_finished_bake_takes_over_options_without_rendering(tmp_path):
    config = {
        "environment": {"emitter": {"type": "constant", "radiance": 1.0}},
        "material": {"bsdf": {"type": "roughconductor", "alpha": 0.3}},
        "map": {"resolution": 8},
        "sampling": {"samples": 4},
    }
    first = rsibr.bake(config, out=tmp_path / "a.rsibr")
    again = rsibr.bake({**config, "methods": {"cabral1999": {"weights": "gnomonic"}}}, out=tmp_path / "a.rsibr")
    assert again.config["methods"] == {"cabral1999": {"weights": "gnomonic"}}
    assert [view.sha256 for view in again.manifest.views] == [view.sha256 for view in first.manifest.views]
    assert again.seconds == pytest.approx(first.seconds, rel=0.05)  # nothing was made
    with pytest.raises(InputError, match=r"methods.cabral1999,weights=area: its name has options"):
        rsibr.bake({**config, "methods": {"cabral1999,weights=area": {}}}, out=tmp_path / "b.rsibr")
    with pytest.raises(InputError, match=r"methods.miller1984.n is not finite: write it as text"):
        rsibr.bake({**config, "methods": {"miller1984": {"n": float("inf")}}}, out=tmp_path / "b.rsibr")
    with pytest.raises(InputError, match=r"methods.cabral1999: cabral1999 has no option 'x'"):
        rsibr.bake({**config, "methods": {"cabral1999": {"x": 1}}}, out=tmp_path / "b.rsibr")
    with pytest.raises(InputError, match="unknown method 'cabral99'"):
        rsibr.plan({**config, "methods": {"cabral99": {}}})


def test_a_method_pays_for_the_files_that_it_reads(small_bakes):
    bake = small_bakes("rough-aluminium")
    methods, light = MethodSet(bake), bake.manifest.light.bytes
    assert methods["rsibr"].cost.bytes == bake.bytes
    assert methods["cabral1999"].cost.bytes == bake.bytes - light
    assert methods["cabral1999"].cost.bake_seconds == bake.seconds > 0
    assert methods["miller1984"].cost.bytes == light
    assert 0 <= methods["miller1984"].cost.bake_seconds < bake.seconds - 0.5 * bake.manifest.seconds
