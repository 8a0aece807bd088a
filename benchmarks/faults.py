"""How many faults, made by hand, do the tests notice?

    python benchmarks/faults.py --workers 16 --out faults.jsonl
    python benchmarks/faults.py --rooms robots,plant --python .venv/bin/python

faults.json holds one small change each (a sign, an axis, a unit, one step, a missing clip, a forgotten
reset), with what goes wrong for whom. They were written at commit 2a70726 by somebody who had not read
the tests; what the code has changed since does not apply any more and does not count. Each is put,
alone, into a copy of the repository. The test files that name the changed module run first, then the
others of its room, until a test fails which passes on an unchanged copy (those of --failing, one a line,
are known not to). One JSON object a fault is appended to --out as it ends; what stands there already is not
run again.
"""

import argparse
import json
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).parents[1]
LEFT_OUT = shutil.ignore_patterns(".*", "__pycache__", "build", "dist", "*.egg-info")
SLOW = re.compile(r"jax|subprocess|shell|realtime")  # what takes seconds to start comes last
FAILED = re.compile(r"^(?:FAILED|ERROR) (tests/.*?)(?: - |$)", re.MULTILINE)
OF_THE_COMMAND = r"footfall\.(?:verbs|cli|options|evaluation|gym|live_state)\b|from footfall import|\bshell\b"


def files_for(fault: dict[str, str], texts: dict[str, str]) -> list[list[str]]:
    """Test files that name the fault's module, and the others of its room, the quick ones of each first."""
    path = Path(fault["file"])
    parts = path.with_suffix("").parts
    module = ".".join(parts if parts[0] == "footfall" else ("footfall", *parts)).removesuffix(".__init__")
    package, name = module.rsplit(".", 1)
    names = (
        rf"\b{re.escape(module)}\b|from {re.escape(package)} import [^\n]*\b{name}\b|{re.escape(path.name)}"
    )
    room = OF_THE_COMMAND if fault["room"] == "footfall" else rf"\bfootfall\.{fault['room']}\b"
    direct = [each for each, text in texts.items() if re.search(names, text)]
    others = [each for each, text in texts.items() if re.search(room, text) and each not in direct]
    batches = []
    for files in (direct, others):
        batches.append([each for each in files if not SLOW.search(texts[each])])
        batches.append([each for each in files if SLOW.search(texts[each])])
    return [batch for batch in batches if batch]


class Tests:
    """Runs tests in copies of the repository."""

    def __init__(self, python: str, cache: Path, timeout_s: float, failing: list[str]) -> None:
        self._python, self._timeout_s = python, timeout_s
        self._environment = os.environ | {
            "OMP_NUM_THREADS": "1",
            "JAX_PLATFORMS": "cpu",
            "JAX_COMPILATION_CACHE_DIR": str(cache),
            "PYTHONDONTWRITEBYTECODE": "1",  # a compiled file could outlive the fault
        }
        self._clean = dict.fromkeys(failing, False)

    def first_failure(self, copy: Path, targets: list[str]) -> str | None:
        """The first test that fails, or that the time ends in; None if all pass."""
        paths = os.pathsep.join([str(copy), *filter(None, [os.environ.get("PYTHONPATH")])])
        command = [self._python, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
        process = subprocess.Popen(
            [*command, "-o", "addopts=", f"--basetemp={copy}-tmp-{threading.get_ident()}", *targets],
            cwd=copy,
            env=self._environment | {"PYTHONPATH": paths},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            output, _ = process.communicate(timeout=self._timeout_s)
        except subprocess.TimeoutExpired:
            return None  # too slow here to tell
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # and whatever its tests left running
        if process.returncode in (0, 5):
            return None
        found = FAILED.search(output)
        if found is None:
            raise RuntimeError(f"pytest ended with {process.returncode}:\n{output[-2000:]}")
        return found[1].strip()

    def passes(self, clean: Path, test: str) -> bool:
        """Whether a test passes on an unchanged copy."""
        if test not in self._clean:  # of two workers that ask at once, each may look
            self._clean[test] = self.first_failure(clean, [test]) is None
        return self._clean[test]

    def without_failing(self, files: list[str]) -> list[str]:
        """Arguments for pytest: the files but for the tests that fail on an unchanged copy, too."""
        failing = {test for test, passed in list(self._clean.items()) if not passed}
        importable = [file for file in files if file not in failing]
        deselected = [argument for test in sorted(failing) for argument in ("--deselect", test)]
        return importable + deselected if importable else []


def notice(fault: dict[str, str], copy: Path, clean: Path, tests: Tests) -> dict[str, object]:
    """Put one fault into a copy, run the tests, take it out again."""
    began, file = time.monotonic(), copy / fault["file"]
    right = file.read_text()
    result: dict[str, object] = {"id": fault["id"], "room": fault["room"], "noticed": None, "by": None}
    if right.count(fault["old"]) != 1:
        return result
    texts = {path.name: path.read_text() for path in sorted((copy / "tests").glob("test_*.py"))}
    try:
        file.write_text(right.replace(fault["old"], fault["new"]))
        for batch in files_for(fault, texts):
            files = [f"tests/{name}" for name in batch]
            while targets := tests.without_failing(files):
                by = tests.first_failure(copy, targets)
                if by is None:
                    break
                if tests.passes(clean, by):
                    return result | {"noticed": True, "by": by, "seconds": round(time.monotonic() - began)}
    finally:
        file.write_text(right)
    return result | {"noticed": False, "seconds": round(time.monotonic() - began)}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--rooms", default="", help="A,B (default: all)")
    parser.add_argument("--python", default=sys.executable, help="which has pytest and footfall's libraries")
    parser.add_argument("--out", type=Path, default=Path("faults.jsonl"))
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds of one pytest")
    parser.add_argument("--failing", type=Path, help="file of tests that fail on an unchanged copy, too")
    parser.add_argument(
        "--time-limit", type=float, default=float("inf"), help="seconds until no fault begins"
    )
    options = parser.parse_args()
    faults = json.loads((ROOT / "benchmarks" / "faults.json").read_text())
    rooms = options.rooms.split(",") if options.rooms else sorted({fault["room"] for fault in faults})
    done = [json.loads(line) for line in options.out.read_text().splitlines()] if options.out.exists() else []
    known = {result["id"] for result in done}
    waiting: queue.SimpleQueue[dict[str, str]] = queue.SimpleQueue()
    for fault in sorted(faults, key=lambda fault: fault["id"].rsplit("-")[-1]):  # in turn over the rooms
        if fault["room"] in rooms and fault["id"] not in known:
            waiting.put(fault)
    began, writing = time.monotonic(), threading.Lock()
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        (scratch / "jax").mkdir(mode=0o700)
        failing = options.failing.read_text().splitlines() if options.failing else []
        tests = Tests(options.python, scratch / "jax", options.timeout, failing)
        copies = [scratch / f"copy{worker}" for worker in range(options.workers + 1)]
        for copy in copies:
            shutil.copytree(ROOT, copy, symlinks=True, ignore=LEFT_OUT)

        def work(copy: Path) -> None:
            while time.monotonic() - began < options.time_limit:
                try:
                    fault = waiting.get_nowait()
                except queue.Empty:
                    return
                try:
                    result = notice(fault, copy, copies[0], tests)
                except RuntimeError as error:  # not kept: it is tried again next time
                    print(f"{fault['id']}: {error}", flush=True)
                    continue
                with writing, options.out.open("a") as out:
                    out.write(json.dumps(result) + "\n")
                    done.append(result)
                    print(json.dumps(result), flush=True)

        threads = [threading.Thread(target=work, args=(copy,)) for copy in copies[1:]]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    applied = [result for result in done if result["noticed"] is not None]
    noticed = Counter(result["room"] for result in applied if result["noticed"])
    for room, number in sorted(Counter(result["room"] for result in applied).items()):
        print(f"{room:12} {noticed[room]:3} of {number}")
    by_id = {fault["id"]: fault for fault in faults}
    for result in applied:
        if not result["noticed"]:
            print(f"{result['id']} {by_id[result['id']]['file']}: {by_id[result['id']]['why']}")


if __name__ == "__main__":
    main()
