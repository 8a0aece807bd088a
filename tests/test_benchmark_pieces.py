"""Long measurements keep what they have, and go on from there."""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from pieces import Result, ResultsFile, run_pieces


def square(piece: int) -> Result:
    return {"square": piece**2}


class TestPieces:
    def test_a_result_is_in_the_file_before_the_next_piece_begins(self, tmp_path: Path) -> None:
        path = tmp_path / "results.jsonl"

        def lines_so_far(_: int) -> Result:
            return {"lines": len(path.read_text().splitlines()) if path.exists() else 0}

        assert run_pieces(lines_so_far, range(3), ResultsFile(path))
        assert [json.loads(line)["lines"] for line in path.read_text().splitlines()] == [0, 1, 2]

    def test_what_a_kill_tore_off_is_done_again_and_nothing_else(self, tmp_path: Path) -> None:
        path = tmp_path / "results.jsonl"
        path.write_text('{"piece": 1, "square": "kept"}\n{"piece": 2, "squ')
        run_pieces(square, [1, 2, 3], ResultsFile(path))
        assert [(each["piece"], each["square"]) for each in ResultsFile(path).results] == [
            (1, "kept"), (2, 4), (3, 9),
        ]  # fmt: skip

    def test_workers_do_the_same_work(self, tmp_path: Path) -> None:
        file = ResultsFile(tmp_path / "results.jsonl")
        assert run_pieces(square, range(4), file, workers=2)
        assert sorted(each["square"] for each in file.results) == [0, 1, 4, 9]

    def test_out_of_time_no_piece_begins(self, tmp_path: Path) -> None:
        file = ResultsFile(tmp_path / "results.jsonl")
        assert not run_pieces(square, range(4), file, time_limit_s=0.0)
        assert not run_pieces(square, range(4), file, workers=2, time_limit_s=0.0)
        assert file.results == []
