"""What only a process of its own can show: signals, pipes, disks, and what `--help` imports."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rsibr.baking.baker import bake
from tests.cli.command import CONFIG, write_config
from tests.store.synthetic import content

RSIBR = [sys.executable, "-c", "from rsibr.cli.app import main; main()"]
SLOW_CONFIG = CONFIG.replace("samples = 16", "samples = 2048").replace("resolution = 8", "resolution = 96")
HEAVY = ("mitsuba", "drjit", "matplotlib", "scipy", "numpy", "OpenEXR", "rich", "rsibr.scene", "rsibr.bake")
ROOT = Path(__file__).parents[2]


def start(*arguments: object, **options: object) -> subprocess.Popen[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    return subprocess.Popen([*RSIBR, *map(str, arguments)], env=environment, text=True, **pipes)


def done(*arguments: object, **options: object) -> tuple[int, str, str]:
    with start(*arguments, **options) as process:
        out, err = process.communicate(timeout=120)
    assert "Traceback" not in (err or "")
    return process.returncode, out, err


@pytest.mark.parametrize("command", [[], ["demo"], ["doctor"], ["plan"], ["bake"], ["reconstruct"], ["validate"]])
def test_help_imports_nothing_heavy(command):
    code = (
        "import sys; sys.argv = ['rsibr', *sys.argv[1:], '--help']\n"
        "from rsibr.cli.app import main\n"
        "try: main()\n"
        "except SystemExit as ended: assert ended.code == 0\n"
        f"print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code, *command], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True
    )
    assert ended.stdout.startswith("Usage: rsibr")
    assert ended.stderr.strip() == "[]"


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Bytes of the maps of a bake that nothing interrupted, by name."""
    folder = tmp_path_factory.mktemp("undisturbed")
    bake(write_config(folder, SLOW_CONFIG), out=folder / "x.rsibr")
    return {name: data for name, data in content(folder / "x.rsibr").items() if name != "manifest.json"}


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_bake_that_is_stopped_goes_on_and_ends_bit_identical(tmp_path, undisturbed, number, code):
    config, out = write_config(tmp_path, SLOW_CONFIG), tmp_path / "x.rsibr"
    with start("bake", config, "--out", out, "--json") as process:
        deadline = time.monotonic() + 60
        while not list(out.glob("maps/view_*.exr")) and time.monotonic() < deadline:
            time.sleep(0.005)
        process.send_signal(number)
        stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == code, stderr
    assert json.loads(stdout)["error"] == {"what": "interrupted", "where": number.name, "fix": "", "exit_code": code}
    assert "Traceback" not in stderr
    begun = {name for name in content(out) if name != "manifest.json"}
    assert 0 < len(begun) < 12
    assert not [name for name in begun if name.endswith("-tmp")]
    bake(config, out=out)
    assert {name: data for name, data in content(out).items() if name != "manifest.json"} == undisturbed


STUCK = """
import sys, time
sys.argv = ["rsibr", "bake", "--json"]
from rsibr.cli import app, watchdog
import drjit as dr
from drjit.llvm import Float, UInt32

def busy():
    state = UInt32(0), dr.arange(Float, 2**12)
    _, x = dr.while_loop(state, lambda i, x: i < 10**9, lambda i, x: (i + 1, dr.sin(x)))
    dr.eval(x)
    print("begun", file=sys.stderr, flush=True)
    {wait}

app.app = lambda **_: busy()
watchdog.GRACE = 0.2
app.main()
"""
"""A command with a kernel of minutes: its main thread waits for it in compiled code, or would do so at the exit."""


@pytest.mark.parametrize("wait", ["dr.sync_thread()", "time.sleep(100)"])
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_command_that_is_stuck_in_compiled_code(number, code, wait):
    program = [sys.executable, "-c", STUCK.format(wait=wait)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": ROOT}
    with subprocess.Popen(program, **pipes) as process:
        try:
            assert process.stderr.readline() == "begun\n"
            time.sleep(0.3)  # into the wait
            sent = time.monotonic()
            process.send_signal(number)
            stdout, stderr = process.communicate(timeout=10)
        finally:
            process.kill()
    assert process.returncode == code
    assert time.monotonic() - sent < 5
    assert stderr == f"interrupted ({number.name})\n"
    assert json.loads(stdout)["error"] == {"what": "interrupted", "where": number.name, "fix": "", "exit_code": code}


def test_the_one_object_stands_alone_on_stdout(tmp_path):
    config = write_config(tmp_path, CONFIG.replace("samples = 16", "samples = 1264"))
    code, stdout, stderr = done("bake", config, "--out", tmp_path / "x.rsibr", "--json")
    assert code == 0, stderr
    assert json.loads(stdout)["views"] == 12


def test_a_closed_stdout_is_no_failure(baked, tmp_path):
    for arguments in (["--help"], ["reconstruct", baked, "--view", "1,2,3", "--out", tmp_path / "x.exr", "--json"]):
        reader, writer = os.pipe()
        os.close(reader)
        code, _, stderr = done(*arguments, stdout=writer)
        os.close(writer)
        assert (code, stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_stdout_on_a_full_disk():
    with Path("/dev/full").open("w") as full:
        code, _, stderr = done("--help", stdout=full)
    assert code == 3
    assert stderr.startswith("error: stdout: cannot be written")


def test_a_name_that_is_no_text_is_refused_in_one_line(tmp_path):
    config = write_config(tmp_path)
    code, stdout, stderr = done("bake", config, "--json", "--set", os.fsdecode(b"environment.file=\xff.exr"))
    assert code == 2
    assert "not UTF-8" in json.loads(stdout)["error"]["what"]
    assert "\\udcff" in stderr


@pytest.fixture
def tiny_disk(tmp_path):
    """Return a file system of 64 KiB."""
    place = tmp_path / "tiny"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(place)]
    if (
        os.geteuid() != 0
        or not shutil.which("mount")
        or subprocess.run(mount, capture_output=True, check=False).returncode
    ):
        pytest.skip("only root can mount a small disk, where that is permitted")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_is_the_machines_lack_and_costs_no_view(shell, tmp_path, tiny_disk):
    config = write_config(tmp_path, CONFIG.replace("resolution = 8", "resolution = 32"))
    out = tiny_disk / "x.rsibr"
    ended = shell.refuses("bake", config, "--out", out, "--yes", "--json", code=3, says="No space left on device")
    assert "Free some space" in ended.stderr
    manifest = json.loads((out / "manifest.json").read_text())
    there = {str(file.relative_to(out)) for file in out.glob("maps/*")}
    listed = {view["file"] for view in manifest["views"] if view["done"]}
    kept = listed | {name.replace(".json", ".exr") for name in there if name.endswith(".json")}
    assert 0 < len(kept) < 12
    assert kept <= there  # a map may be there that its sidecar had no room beside: the next writer sweeps it
    subprocess.run(["mount", "-o", "remount,size=1m", str(tiny_disk)], check=True)
    assert shell("bake", config, "--out", out, "--yes").code == 0


def test_a_folder_that_may_not_be_written_to(tmp_path):
    if os.geteuid() == 0 and not shutil.which("setpriv"):
        pytest.skip("root may write anywhere, and there is no setpriv to become another")
    place = tmp_path / "locked"
    place.mkdir(mode=0o555)
    code = (
        "import sys; sys.argv = ['rsibr', *sys.argv[1:]]\n"
        "from rsibr.store.writer import BakeWriter\nfrom rsibr.errors import RsibrError\n"
        "from rsibr.cli.options import check_output_folder\nfrom pathlib import Path\n"
        "from tests.store import synthetic\n"
        "for attempt in (lambda p: BakeWriter.open(p, synthetic.manifest()), check_output_folder):\n"
        "    try: attempt(Path(sys.argv[1]) / 'x')\n"
        "    except RsibrError as error: print(error.exit_code, error)\n"
    )
    # Runs as nobody from a copy of nothing: only the parents of the folder need to be open to it.
    for parent in (tmp_path, tmp_path.parent, tmp_path.parent.parent):
        parent.chmod(0o755)
    command = [sys.executable, "-c", code, str(place)]
    if os.geteuid() == 0:
        command = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", *command]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    if "Permission denied" in ended.stderr or "No module named" in ended.stderr:
        pytest.skip("this Python is not open to other users")
    lines = ended.stdout.splitlines()
    assert len(lines) == 2, ended.stderr
    assert all(line.startswith("2 ") for line in lines)
    assert "Permission denied" in lines[0]
    assert "is not writable" in lines[1]
