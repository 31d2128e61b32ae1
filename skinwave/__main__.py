"""`python -m skinwave`: the command line."""

import sys

from skinwave.commands.cli import main

sys.exit(main())
