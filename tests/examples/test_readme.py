"""The table of examples."""

from user_folder import EXAMPLES

LONGEST = 90  # lines


def test_every_example_is_in_the_table_and_short() -> None:
    table = (EXAMPLES / "README.md").read_text()
    files = [path for path in EXAMPLES.rglob("*") if path.is_file() and path.suffix not in (".pyc", ".md")]
    assert files
    for path in files:
        assert f"]({path.relative_to(EXAMPLES).as_posix()})" in table, path
        assert len(path.read_text().splitlines()) <= LONGEST, path
