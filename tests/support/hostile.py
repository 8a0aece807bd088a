"""Content of a hostile file."""

import os
from pathlib import Path


class Hostile:
    """Reading it from a pickle makes a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple:
        return os.mkdir, (str(self.folder),)
