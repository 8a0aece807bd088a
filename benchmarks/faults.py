"""How many faults, written by hand, do the tests notice?

    python benchmarks/faults.py --workers 16 --out faults.jsonl
    python benchmarks/faults.py --rooms robots,plant --python .venv/bin/python
    python benchmarks/faults.py --faults benchmarks/fresh_faults.json

Each entry of faults.json is one small change (a sign, an axis, a unit, one step, a missing clip, a forgotten
reset) and its consequence for a user. They were written at commit 0e3b032, those from number 21 on at
b2090f6, by authors who had not read the tests. fresh_faults.json holds 100 others, written at commit c24c935
from the source alone; their files were drawn at random, weighted by lines. An entry whose line has changed
since is skipped and does not count.

Each fault is applied, alone, to a copy of the repository, on which a few test files run at a time. Files that
name the changed module run first, `test_<module>.py` before the others. Faults that these do not notice then
get the other test files of their room. A fault is done when a test fails that passes on an unchanged copy;
--failing lists tests that fail there, one a line. One JSON object for each run is appended to --out as it
ends; runs that are already in --out are not repeated.
A fault is noticed if a test fails, and not noticed if all files of its room have passed. It is open if some
were not run or ran out of time.
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
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
NOT_COPIED = shutil.ignore_patterns(".*", "__pycache__", "build", "dist", "*.egg-info")
FILES_AT_ONCE = 6
SLOW = re.compile(r"jax|subprocess|shell|realtime")  # test files with these words take seconds to start
FAILED = re.compile(r"^(?:FAILED|ERROR) (tests/.*?)(?: - |$)", re.MULTILINE)
COMMAND_LINE = r"footfall\.(?:verbs|cli|options|evaluation|gym|live_state)\b|from footfall import|\bshell\b"


@dataclass(frozen=True)
class Job:
    """Test files to run on a copy of the repository with one fault."""

    fault: dict[str, str]
    files: tuple[str, ...]
    stage: int  # 0: tests that name the module, quick ones; 1: its slow ones; 2, 3: the room's others


def jobs_for(fault: dict[str, str], texts: dict[str, str]) -> list[Job]:
    """Test files that name the fault's module, and the others of its room, the quick ones of each first."""
    path = Path(fault["file"])
    parts = path.with_suffix("").parts
    in_package = parts[1:] if parts[0] == "src" else ("footfall", *parts)
    module = ".".join(in_package).removesuffix(".__init__")
    package, name = module.rsplit(".", 1)
    names = (
        rf"\b{re.escape(module)}\b|from {re.escape(package)} import [^\n]*\b{name}\b|{re.escape(path.name)}"
    )
    room = COMMAND_LINE if fault["room"] == "footfall" else rf"\bfootfall\.{fault['room']}\b"
    direct = [each for each, text in texts.items() if re.search(names, text)]
    direct.sort(key=lambda each: Path(each).stem != f"test_{name}")
    others = [each for each, text in texts.items() if re.search(room, text) and each not in direct]
    stages = [
        [f"tests/{each}" for each in files if bool(SLOW.search(texts[each])) == slow]
        for files in (direct, others)
        for slow in (False, True)
    ]
    return [
        Job(fault, tuple(files[first : first + FILES_AT_ONCE]), stage)
        for stage, files in enumerate(stages)
        for first in range(0, len(files), FILES_AT_ONCE)
    ]


class Tests:
    """Runs tests in copies of the repository."""

    def __init__(self, python: str, cache: str, timeout_s: float, failing: list[str]) -> None:
        self._python, self._timeout_s = python, timeout_s
        self._environment = os.environ | {
            "OMP_NUM_THREADS": "1",
            "JAX_PLATFORMS": "cpu",
            "JAX_COMPILATION_CACHE_DIR": cache,
            "PYTHONDONTWRITEBYTECODE": "1",  # a compiled file could outlive the fault
        }
        self._clean = dict.fromkeys(failing, False)

    def first_failure(self, copy: Path, targets: list[str]) -> str | None:
        """The first test that fails; None if all pass.

        Raises subprocess.TimeoutExpired if they take too long, RuntimeError if pytest itself fails.
        """
        paths = os.pathsep.join([str(copy / "src"), *filter(None, [os.environ.get("PYTHONPATH")])])
        command = [self._python, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
        command += ["-o", "addopts=--import-mode=importlib"]  # else two files of one name fail together
        process = subprocess.Popen(
            [*command, f"--basetemp={copy}-tmp-{threading.get_ident()}", *targets],
            cwd=copy,
            env=self._environment | {"PYTHONPATH": paths},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            output, _ = process.communicate(timeout=self._timeout_s)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # also the processes that its tests left running
        if process.returncode in (0, 5):
            return None
        found = FAILED.search(output)
        if found is None:
            raise RuntimeError(f"pytest ended with {process.returncode}:\n{output[-2000:]}")
        return found[1].strip()

    def passes(self, clean: Path, test: str) -> bool:
        """Whether a test passes on an unchanged copy."""
        if test not in self._clean:  # two workers that ask at the same time may both run the test
            self._clean[test] = self.first_failure(clean, [test]) is None
        return self._clean[test]

    def without_failing(self, files: Sequence[str]) -> list[str]:
        """Arguments for pytest: the files, without the tests that also fail on an unchanged copy."""
        failing = {test for test, passed in list(self._clean.items()) if not passed}
        importable = [file for file in files if file not in failing]
        deselected = [argument for test in sorted(failing) for argument in ("--deselect", test)]
        return importable + deselected if importable else []


def run(job: Job, copy: Path, clean: Path, tests: Tests) -> dict[str, object]:
    """Put a job's fault into a copy, run the job's tests, take the fault out again."""
    began, file = time.monotonic(), copy / job.fault["file"]
    original, failed, timed_out = file.read_text(), None, False
    try:
        file.write_text(original.replace(job.fault["old"], job.fault["new"]))
        while targets := tests.without_failing(job.files):
            failed = tests.first_failure(copy, targets)
            if failed is None or tests.passes(clean, failed):
                break
            failed = None
    except subprocess.TimeoutExpired:
        timed_out = True
    finally:
        file.write_text(original)
    seconds = round(time.monotonic() - began)
    return {
        "id": job.fault["id"],
        "files": job.files,
        "by": failed,  # the test that noticed the fault
        "timed_out": timed_out,
        "seconds": seconds,
    }


def print_score(faults: list[dict[str, str]], jobs: list[Job], results: list[dict[str, Any]]) -> None:
    """Print the numbers of noticed, not noticed and open faults of each room; then list the latter two."""
    noticed = {result["id"] for result in results if result["by"]}
    passed = {
        (result["id"], file)
        for result in results
        if not result["by"] and not result["timed_out"]
        for file in result["files"]
    }
    unfinished = {
        job.fault["id"] for job in jobs if any((job.fault["id"], file) not in passed for file in job.files)
    }
    for room in sorted({fault["room"] for fault in faults}):
        ids = {fault["id"] for fault in faults if fault["room"] == room}
        missed = ids - noticed - unfinished
        print(
            f"{room:12} {len(ids & noticed):3} of {len(ids)} noticed, {len(missed)} not, "
            f"{len(ids) - len(ids & noticed) - len(missed)} open"
        )
    for fault in faults:
        if fault["id"] not in noticed:
            word = "open" if fault["id"] in unfinished else "not noticed"
            print(f"{fault['id']} {word}: {fault['file']}: {fault['why']}")


def test_texts() -> dict[str, str]:
    """Each test file's text by its path below tests/."""
    paths = sorted((ROOT / "tests").rglob("test_*.py"))
    return {str(path.relative_to(ROOT / "tests")): path.read_text() for path in paths}


def read_options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--faults", type=Path, default=ROOT / "benchmarks" / "faults.json")
    parser.add_argument("--rooms", default="", help="A,B: rooms, or single faults by id (default: all)")
    parser.add_argument(
        "--python",
        default=sys.executable,
        type=os.path.abspath,  # tests run in another folder
        help="path of a Python with pytest and footfall's libraries",
    )
    parser.add_argument("--out", type=Path, default=Path("faults.jsonl"))
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds of one pytest")
    parser.add_argument("--failing", type=Path, help="file of tests that fail on an unchanged copy, too")
    parser.add_argument(
        "--time-limit", type=float, default=float("inf"), help="no fault begins after this many seconds"
    )
    return parser.parse_args()


def main() -> None:
    options = read_options()
    faults = json.loads(options.faults.read_text())
    rooms = options.rooms.split(",") if options.rooms else sorted({fault["room"] for fault in faults})
    faults = [
        fault
        for fault in faults
        if {fault["room"], fault["id"]} & set(rooms)
        and (ROOT / fault["file"]).read_text().count(fault["old"]) == 1
    ]
    results = (
        [json.loads(line) for line in options.out.read_text().splitlines()] if options.out.exists() else []
    )
    known = {(result["id"], tuple(result["files"])) for result in results if not result["timed_out"]}
    noticed = {result["id"] for result in results if result["by"]}
    texts = test_texts()
    jobs = [job for fault in faults for job in jobs_for(fault, texts)]
    waiting: queue.SimpleQueue[Job] = queue.SimpleQueue()
    for job in sorted(jobs, key=lambda job: (job.stage, job.fault["id"].rsplit("-")[-1])):
        if (job.fault["id"], job.files) not in known:
            waiting.put(job)
    began, out_lock = time.monotonic(), threading.Lock()
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        (scratch / "jax").mkdir(mode=0o700)
        failing = options.failing.read_text().splitlines() if options.failing else []
        cache = os.environ.get("JAX_COMPILATION_CACHE_DIR", str(scratch / "jax"))
        tests = Tests(options.python, cache, options.timeout, failing)
        copies = [scratch / f"copy{worker}" for worker in range(options.workers + 1)]
        for copy in copies:
            shutil.copytree(ROOT, copy, symlinks=True, ignore=NOT_COPIED)

        def work(copy: Path) -> None:
            while time.monotonic() - began < options.time_limit:
                try:
                    job = waiting.get_nowait()
                except queue.Empty:
                    return
                if job.fault["id"] in noticed:
                    continue
                try:
                    result = run(job, copy, copies[0], tests)
                except RuntimeError as error:  # not kept: it is tried again next time
                    print(f"{job.fault['id']}: {error}", flush=True)
                    continue
                with out_lock, options.out.open("a") as out:
                    out.write(json.dumps(result) + "\n")
                    results.append(result)
                    if result["by"]:
                        noticed.add(job.fault["id"])
                    print(json.dumps(result), flush=True)

        threads = [threading.Thread(target=work, args=(copy,)) for copy in copies[1:]]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    print_score(faults, jobs, results)


if __name__ == "__main__":
    main()
