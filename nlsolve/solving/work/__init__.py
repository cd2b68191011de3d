"""Work that is counted and timed where it is done: the ledger, and what problems and matrices enter there."""
