"""What the page holds of an object, its server, its refusals, the command, and what notebooks show."""

import gzip
import http.client
import json
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import rsibr
from rsibr.errors import InputError, MachineError
from rsibr.geometry.frame import view_frame
from rsibr.publishing.notebooks.cards import validation_card
from rsibr.publishing.notebooks.plots import plot_validation
from rsibr.publishing.page import object_mesh as page_mesh
from rsibr.publishing.page import view
from rsibr.publishing.page.server import PageServer
from rsibr.resources import scenes
from rsibr.shading.scenes.scene_file import open_scene
from rsibr.shading.scenes.triangles import triangle_meshes
from rsibr.validation.report.references import read_references
from rsibr.validation.report.report import write_report
from tests.publishing.viewer_page import viewer_page
from tests.validation.results_double import small_validation

ROUND = {
    "type": "scene",
    "ball": {"type": "sphere", "center": [1, 2, 3], "radius": 0.5},
    "can": {"type": "cylinder", "p0": [0, 0, 0], "p1": [0, 2, 0], "radius": 0.7},
    "lid": {"type": "disk"},
    "wall": {"type": "rectangle"},
}


def test_round_shapes_are_tessellated_on_their_surface():
    found = triangle_meshes(open_scene(ROUND))
    ball, can, lid = found["ball"], found["can"], found["lid"]
    assert np.abs(np.linalg.norm(ball.vertices - [1, 2, 3], axis=1) - 0.5).max() < 1e-5
    assert np.abs(ball.normals - (ball.vertices - [1, 2, 3]) / 0.5).max() < 1e-5
    assert np.abs(np.hypot(can.vertices[:, 0], can.vertices[:, 2]) - 0.7).max() < 1e-5
    assert np.abs(lid.normals - [0, 0, 1]).max() == 0
    for mesh, area in ((ball, np.pi), (can, 2.8 * np.pi), (lid, np.pi), (found["wall"], 4)):
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(area, rel=2e-3)


def test_an_object_s_triangles_lie_by_bake_and_within_16_bits():
    scene = open_scene(ROUND)
    made = page_mesh.object_mesh(scene, {"ball": 1, "can": 0, "lid": 1})
    parts = made.meta["parts"]
    assert [part["bake"] for part in parts] == [-1, 0, 1]
    assert sum(part["count"] for part in parts) == 3 * made.meta["triangles"]
    places = decoded(made.arrays["positions"], np.int16).reshape(3, -1).T / 32767 * 0.5 + 0.5
    vertices = np.array(made.meta["lowest"]) + places * made.meta["extent"]
    faces = np.cumsum(decoded(made.arrays["faces"], np.uint32), dtype=np.uint32)
    can = vertices[faces[parts[1]["first"] :][: parts[1]["count"]]]
    assert np.abs(np.hypot(can[:, 0], can[:, 2]) - 0.7).max() < max(made.meta["extent"]) / 40000


def decoded(array, kind):
    planes = np.frombuffer(gzip.decompress(array.data), np.uint8).reshape(np.dtype(kind).itemsize, -1)
    return planes.T.copy().view(kind).ravel()


def test_a_mesh_too_large_is_refused_unless_asked_for(monkeypatch):
    monkeypatch.setattr(page_mesh, "MOST_TRIANGLES", 1000)
    scene = open_scene("sphere")
    with pytest.raises(InputError, match="16384 triangles"):
        page_mesh.object_mesh(scene, {"sphere": 0})
    assert page_mesh.object_mesh(scene, {"sphere": 0}, allow_large=True).meta["triangles"] == 16384


def test_references_come_back_from_a_report(tmp_path):
    validation = small_validation()
    validation.bake.details["config_hash"] = "ab"
    write_report(validation, tmp_path)
    found = read_references(tmp_path)
    assert (found.config_hash, found.labels) == ("ab", ["triangle centroid", "random"])
    for one, judged in zip(found.maps, validation.views, strict=True):
        assert np.array_equal(one.radiance, judged.reference.mean)
        assert np.array_equal(one.variance, judged.reference.variance_of_mean)
        assert np.allclose(one.frame, view_frame(judged.view), atol=1e-6)


def test_what_is_no_validation_of_the_bake_is_refused(baked, tmp_path):
    bake = baked("rough-aluminium")
    with pytest.raises(InputError, match=r"no metrics\.json"):
        view(bake, reference=tmp_path)
    validation = small_validation()
    validation.bake.details["config_hash"] = "ab"
    write_report(validation, tmp_path)
    with pytest.raises(InputError, match="another bake"):
        view(bake, reference=tmp_path)
    with pytest.raises(InputError, match="no object"):
        view({"body": bake, "metal": bake})
    with pytest.raises(InputError, match="no shape 'bonnet'"):
        view({"bonnet": bake}, mesh="sphere")


def test_the_server_gives_its_page_and_nothing_else():
    with PageServer("<p>page</p>") as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        answers = [ask(server.server_port, *asked) for asked in (("/",), ("/etc/passwd",), ("/", "evil.example"))]
        server.shutdown()
        assert server.server_address[0] == "127.0.0.1"
    assert answers[0] == (200, b"<p>page</p>")
    assert [status for status, _ in answers[1:]] == [404, 421]


def ask(port, path, host=None):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    connection.request("GET", path, headers={"Host": host} if host else {})
    answer = connection.getresponse()
    return answer.status, answer.read()


def test_a_port_that_is_taken_is_told():
    with PageServer("") as server, pytest.raises(InputError, match="cannot be used"):
        PageServer("", server.server_port)


def test_results_are_tables_plots_and_cards(tmp_path, monkeypatch):
    validation = small_validation()
    frame = validation.to_dataframe()
    assert list(frame["method"]) == ["nearest", "cabral1999", "perfect"] * 2
    assert frame["rel_mse"][0] == pytest.approx(validation.views[0].methods["nearest"].error.rel_mse.value)
    validation.to_csv(tmp_path / "errors.csv")
    assert (tmp_path / "errors.csv").read_text() == validation.csv()
    card = validation_card(validation)
    assert "red &lt;paint&gt;" in card
    assert card.count("<img") == 4
    assert len(card) < 80_000
    texts = [text.get_text() for text in plot_validation(validation).axes[0].get_legend().get_texts()]
    assert texts == ["nearest", "cabral1999", "perfect"]
    shown = [axes.get_title().partition("\n")[0] for axes in validation.show(errors=True).axes]
    assert shown == ["reference", "nearest", "cabral1999", "perfect", "", "", "", "", ""]  # a scale at the end
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MachineError, match="pandas is not installed"):
        validation.to_dataframe()


def test_a_bake_shows_itself(baked):
    bake = baked("rough-aluminium")
    assert len(bake.show(most=4).axes) == 4
    assert f"{bake.view_count} views of 32²" in bake._repr_html_()
    made = rsibr.reconstruct(bake, (1, 2, 3), method="cabral1999")
    assert "cabral1999" in made._repr_html_()
    frame = bake.view(methods=["nearest"])._repr_html_()
    assert frame.startswith('<iframe srcdoc="&lt;!doctype html&gt;')
    assert frame.count("<") == 2  # all of the page lies within the attribute


@pytest.mark.slow
def test_the_command_exports_and_serves_until_ctrl_c(baked, tmp_path):
    bake, file = str(baked("rough-aluminium").path), tmp_path / "page.html"
    command = [str(Path(sys.executable).with_name("rsibr")), "view", bake, "--method", "nearest"]
    done = subprocess.run([*command, "--export", str(file), "--json"], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["bytes"] == file.stat().st_size
    served = subprocess.Popen([*command, "--no-open", "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    told = json.loads(served.stdout.readline())
    status, page = ask(told["port"], "/")
    assert (status, page) == (200, file.read_bytes())
    served.send_signal(signal.SIGINT)
    assert served.wait(timeout=10) == 0
    wrong = subprocess.run([*command, "--export", str(tmp_path / "a.png")], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2
    assert "--export" in wrong.stderr


@pytest.mark.slow
def test_the_demo_takes_less_than_two_mebibytes(tmp_path):
    bake = rsibr.bake(rsibr.configs() / "demo.toml", out=tmp_path / "paint.rsibr")
    assert view(bake).bytes < 2 * 2**20


@pytest.mark.slow
def test_the_car_is_drawn_from_three_bakes(browser, baked, tmp_path):
    car = scenes() / "objects" / "car.xml"
    materials = {"body": "rough-aluminium", "rubber": "glossy-plastic", "metal": "rough-aluminium"}
    page = view({shape: baked(name) for shape, name in materials.items()}, mesh=car)
    assert any("'glass'" in note for note in page.notes)
    file = page.write(tmp_path / "car.html")
    with viewer_page(browser, file, 480, 320) as opened:
        shown = {}
        for method in ("nearest", "blend", "cabral1999", "rsibr"):
            opened.set(method=method, size=128)
            shown[method] = opened.pixels()
            assert 0.1 < (shown[method][..., 3] == 255).mean() < 0.6
        assert np.abs(shown["rsibr"] - shown["nearest"]).mean() > 0.5
        assert opened.page.locator("#show").is_hidden()
