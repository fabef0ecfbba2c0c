"""``python -m losnav.cli``: the same program as ``losnav``."""

import sys

from losnav.cli import main

if __name__ == "__main__":
    sys.exit(main())
