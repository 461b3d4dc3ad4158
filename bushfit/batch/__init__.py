"""Many campaigns at once: the rows of a manifest through the commands of a single campaign, on cores or on a cluster.

manifest (rows) -> executor (workers) -> row (one part) -> store (its folder) -> summary (table, limits, page).
"""
