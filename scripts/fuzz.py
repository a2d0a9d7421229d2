"""Feed altered inputs to everything that reads, and report how each ended.

`python scripts/fuzz.py --inputs 10000 --seed 0 --out out/fuzz.json` ends with exit code 1 where an input led to
anything but success or one clear error: a traceback, a crash, a hang, a write outside the folder that is its own.
`--only TARGET:NUMBER` runs one input again, and shows what it raises.
"""

from __future__ import annotations

import argparse
import json
import os
import selectors
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

TARGETS = {
    "config-bytes": 0.08, "config-tables": 0.08, "override": 0.06, "views": 0.05, "environment": 0.06,
    "emitter": 0.04, "bsdf": 0.05, "xml": 0.04, "bake": 0.05, "command-line": 0.04,
    "stranger-manifest": 0.10, "stranger-map": 0.08, "stranger-light": 0.04, "stranger-files": 0.02,
    "radiance": 0.07, "exr": 0.08, "mesh": 0.04, "scene": 0.02,
}  # fmt: skip
"""What is fuzzed, and its share of the inputs; of `radiance` and `exr` the right picture is known."""

PLUGINS = ("emitter", "bsdf", "xml", "scene")
"""Targets that a user's command loads in a process of its own first: a crash there must end as an error."""

SLOWEST = ("stranger-manifest", "stranger-map", "bsdf", "xml", "emitter", "scene")
"""Targets that are begun first, so that the processors end together."""

TIMEOUT = 60.0
"""Seconds after which an input counts as hung; the first one of a process includes its start."""

IN_TRIAL = "RSIBR_IN_TRIAL"


def main() -> int:
    """Parse the command line, fuzz, write the report; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=10_000, help="how many, all targets together")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="where to write the report as JSON")
    parser.add_argument("--only", metavar="TARGET:NUMBER", help="run one input, in this process")
    parser.add_argument(
        "--worker", nargs=5, metavar=("TARGET", "FIRST", "LAST", "FOLDER", "BAKE"), help=argparse.SUPPRESS
    )
    options = parser.parse_args()
    if options.worker:
        target, first, last, folder, bake = options.worker
        work(target, options.seed, int(first), int(last), Path(folder), Path(bake))
        return 0
    with tempfile.TemporaryDirectory() as name:
        bake = small_bake(Path(name))
        if options.only:
            target, _, number = options.only.partition(":")
            folder = Path(name) / "only"
            folder.mkdir()
            prepare(folder, bake).case(target, options.seed, int(number))()
            return 0
        report = fuzz(options.inputs, options.seed, Path(name), bake)
    show(report)
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(json.dumps(report, indent=1) + "\n")
    return 1 if report["failures"] else 0


def fuzz(inputs: int, seed: int, folder: Path, bake: Path) -> dict[str, Any]:
    """Run all targets, and count how the inputs ended."""
    start = time.perf_counter()
    counts: dict[str, Counter[str]] = {}
    failures: list[dict[str, Any]] = []

    def ended(target: str) -> tuple[str, list[tuple[int, str, str]]]:
        total = max(1, -int(-inputs * TARGETS[target] // 1))
        return target, [
            (number, *contained(target, seed, number, folder, bake))
            if outcome in ("crash", "hang") and target in PLUGINS
            else (number, outcome, detail)
            for number, outcome, detail in endings(target, seed, total, folder, bake)
        ]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for target, found in pool.map(ended, sorted(TARGETS, key=lambda name: name not in SLOWEST)):
            counts[target] = Counter(outcome for _, outcome, _ in found)
            failures += [
                {"target": target, "number": number, "outcome": outcome, "detail": detail}
                for number, outcome, detail in found
                if outcome not in ("accepted", "refused", "crash contained")
            ]
            sys.stderr.write(f"{target}: {dict(counts[target])}\n")
    total = sum(counter.total() for counter in counts.values())
    return {
        "seed": seed,
        "inputs": total,
        "seconds": round(time.perf_counter() - start, 1),
        "targets": {target: dict(counter) for target, counter in counts.items()},
        "failures": failures,
    }


def endings(target: str, seed: int, total: int, folder: Path, bake: Path) -> list[tuple[int, str, str]]:
    """Run the inputs 0 … total − 1 of a target in worker processes; a worker that dies is followed by another."""
    found: list[tuple[int, str, str]] = []
    while len(found) < total:
        worker = start_worker(target, seed, len(found), total, folder, bake, trial=False)
        for number, outcome, detail in listen(worker):
            found.append((number, outcome, detail))
        died = worker.poll() is None
        worker.kill()
        code = worker.wait()
        if len(found) < total:
            found.append((len(found), "hang" if died else "crash", f"exit code {code}"))
    return found


def listen(worker: subprocess.Popen[bytes]) -> list[tuple[int, str, str]]:
    """Collect what a worker says, until it ends or is silent for `TIMEOUT`."""
    said = b""
    descriptor = worker.stdout.fileno() if worker.stdout else -1
    with selectors.DefaultSelector() as selector:
        selector.register(descriptor, selectors.EVENT_READ)
        while selector.select(TIMEOUT):
            chunk = os.read(descriptor, 1 << 16)
            if not chunk:
                worker.wait()
                break
            said += chunk
    whole = said[: said.rfind(b"\n") + 1]
    return [tuple(json.loads(line)) for line in whole.splitlines()]


def contained(target: str, seed: int, number: int, folder: Path, bake: Path) -> tuple[str, str]:
    """Run an input that ended its process once more, with the trial that a user's command makes first."""
    worker = start_worker(target, seed, number, number + 1, folder, bake, trial=True)
    said = listen(worker)
    worker.kill()
    worker.wait()
    if said and said[0][1] == "refused":
        return "crash contained", said[0][2]
    return "crash", said[0][2] if said else "not contained"


def start_worker(
    target: str, seed: int, first: int, last: int, folder: Path, bake: Path, *, trial: bool
) -> subprocess.Popen[bytes]:
    """Start a process that runs the inputs from `first` up to, not including, `last`."""
    own = folder / f"{target}-{first}-{trial}"
    own.mkdir()
    environment = {key: value for key, value in os.environ.items() if key != IN_TRIAL} | {"TMPDIR": str(own)}
    if not trial:
        environment[IN_TRIAL] = "1"
    command = [sys.executable, __file__, "--seed", str(seed), "--worker"]
    arguments = [target, str(first), str(last), str(own), str(bake)]
    return subprocess.Popen(
        [*command, *arguments], env=environment, cwd=own, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )


def work(target: str, seed: int, first: int, last: int, folder: Path, bake: Path) -> None:
    """Run inputs, and say how each ended on stdout, a line each."""
    channel = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # libraries print there
    inputs = prepare(folder, bake)
    from fuzz_inputs import audit_writes  # noqa: PLC0415

    outside: list[str] = []
    audit_writes(folder, outside)
    for number in range(first, last):
        case = inputs.case(target, seed, number)
        outside.clear()
        outcome, detail = ending(case)
        if outside:
            outcome, detail = "write outside", "; ".join(outside)
        channel.write(json.dumps([number, outcome, detail]) + "\n")
        channel.flush()


def ending(case: Any) -> tuple[str, str]:
    """Run one input: how it ended, and what it said."""
    from rsibr.errors import RsibrError  # noqa: PLC0415

    try:
        case()
    except RsibrError as error:
        line = str(error)
        return ("refused", line) if line.strip() and "\n" not in line else ("unclear", repr(line))
    except BaseException:
        return "traceback", traceback.format_exc()[-3000:]
    return "accepted", ""


def prepare(folder: Path, bake: Path) -> Any:
    """Load what is under test."""
    import warnings  # noqa: PLC0415

    from fuzz_inputs import Inputs, stop_short_of_rendering  # noqa: PLC0415

    from rsibr import backend  # noqa: PLC0415

    warnings.simplefilter("ignore")
    backend.use()
    stop_short_of_rendering()
    return Inputs(folder, bake)


def small_bake(folder: Path) -> Path:
    """Bake tiny maps, and beside them those of a stranger; in a process of its own."""
    import fuzz_bakes  # noqa: PLC0415
    from fuzz_inputs import CONFIG, STRANGER  # noqa: PLC0415

    for name, config in (("small.rsibr", CONFIG), (STRANGER, fuzz_bakes.CONFIG)):
        (folder / "config.toml").write_text(config)
        code = "import sys, rsibr; rsibr.bake(sys.argv[1], out=sys.argv[2])"
        command = [sys.executable, "-c", code, str(folder / "config.toml"), str(folder / name)]
        subprocess.run(command, check=True, capture_output=True)
    code = "import sys, pathlib, fuzz_bakes; fuzz_bakes.stranger(pathlib.Path(sys.argv[1]))"
    command = [sys.executable, "-c", code, str(folder / STRANGER)]
    subprocess.run(command, check=True, capture_output=True, cwd=Path(__file__).parent)
    return folder / "small.rsibr"


def show(report: dict[str, Any]) -> None:
    """Print the counts, and each failure."""
    for target, counts in report["targets"].items():
        sys.stdout.write(
            f"{target:14} " + ", ".join(f"{count} {name}" for name, count in sorted(counts.items())) + "\n"
        )
    for failure in report["failures"]:
        last = failure["detail"].strip().splitlines()[-1:] or [""]
        sys.stdout.write(f"FAILED {failure['target']}:{failure['number']} {failure['outcome']}: {last[0]}\n")
    sys.stdout.write(
        f"{report['inputs']} inputs in {report['seconds']} s, seed {report['seed']}: {len(report['failures'])} failed\n"
    )


if __name__ == "__main__":
    sys.exit(main())
