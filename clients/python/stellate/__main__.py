"""`python -m stellate`: see _command_line."""

import sys

from ._command_line import main

if __name__ == "__main__":
    sys.exit(main())
