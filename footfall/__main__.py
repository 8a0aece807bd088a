"""`python -m footfall`."""

import sys

from footfall.cli import main

if __name__ == "__main__":
    sys.exit(main())
