"""`python -m skinwave`: the command line."""

import sys

from skinwave.cli import main

sys.exit(main())
