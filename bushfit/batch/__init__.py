"""Many campaigns at once: a manifest's rows through the jobs of the single commands, on cores or on a cluster.

manifest (rows) -> pool (workers) -> work (one row) -> ledger (its folder) -> outcome (table, limits, picture, page).
"""
