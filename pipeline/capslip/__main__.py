"""Run the command line as `python -m capslip`."""

import sys

if not sys.flags.safe_path:  # `-m` puts the working folder first: scans lie there, not modules
    del sys.path[0]

from capslip.cli import main

main()
