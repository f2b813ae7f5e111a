"""`python -m capslip.studies.level` prints the tables."""

from capslip.studies.level.study import main

main()
