"""Many campaigns at once: run the commands of a single campaign on each row of a manifest, on cores or a cluster.

manifest (rows) -> executor (workers) -> row (one part) -> store (its folder) -> summary (table, limits, page).
"""
