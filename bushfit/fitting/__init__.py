"""Fits: residuals in units of noise, least squares, uncertainty."""
