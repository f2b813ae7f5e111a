"""Run the command line as `python -m capslip`."""

from capslip.cli import main

main()
