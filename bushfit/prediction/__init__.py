"""Predictions of a model: stiffness with bands, their caveats, and the comparison of two results."""
