"""`python -m capslip.studies.band` prints the table."""

from capslip.studies.band.study import main

main()
