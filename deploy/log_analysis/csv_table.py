"""Values of a CSV file by column name."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError

ALL = "all"  # key for all joints without their own entry

DELIMITERS = ",;\t"  # spreadsheets use semicolons where the decimal separator is a comma

Column = str | float
"""Name of a column, or a constant."""


class CsvTable(NamedTuple):
    """Cells of a file with column names in the first line."""

    path: Path
    names: list[str]
    rows: list[list[str]]

    def take(self, columns: Sequence[Column]) -> np.ndarray:
        """Values of some columns, (T, k).

        Raises:
            UserError: a column is missing, or a cell is not a finite number.
        """
        values = np.empty((len(self.rows), len(columns)))
        for index, column in enumerate(columns):
            values[:, index] = self._column(column) if isinstance(column, str) else column
        return values

    def take_named(self, chosen: Mapping[str, Column], names: Sequence[str], what: str) -> np.ndarray:
        """Values for each joint or foot, (T, n).

        Args:
            chosen: column for each; `ALL` applies to those without an entry.
            names: names of the robot's joints or feet, in order.
            what: field of the map, for messages.

        Raises:
            UserError: as `take`, or the map has joints or feet that the robot does not have.
        """
        missing = [name for name in names if name not in chosen and ALL not in chosen]
        unknown = [name for name in chosen if name not in names and name != ALL]
        if missing or unknown:
            wrong = f"lacks {missing[0]}" if missing else f"names {unknown[0]}, which the robot does not have"
            raise UserError(f"{what} of the map {wrong}: the robot has {', '.join(names)}")
        return self.take([chosen[name] if name in chosen else chosen[ALL] for name in names])

    def _column(self, name: str) -> list[float]:
        if name not in self.names:
            raise UserError(f"{self.path} has no column '{name}': it has {', '.join(self.names)}")
        index = self.names.index(name)
        return [self._number(line, row, index) for line, row in enumerate(self.rows)]

    def _number(self, line: int, row: list[str], index: int) -> float:
        try:
            value = float(row[index])
        except (ValueError, IndexError):
            value = np.nan
        if not np.isfinite(value):
            raise UserError(f"{self.path}, line {line + 2}: no number in column '{self.names[index]}'")
        return value


def read_table(path: Path) -> CsvTable:
    """Cells of a file; the most frequent delimiter of its first line separates them.

    Raises:
        UserError: it cannot be read, or is empty.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:  # a file may begin with a byte order mark
            first = file.readline()
            file.seek(0)
            rows = [row for row in csv.reader(file, delimiter=max(DELIMITERS, key=first.count)) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from None
    if not rows:
        raise UserError(f"{path} is empty")
    return CsvTable(path, [name.strip() for name in rows[0]], rows[1:])
