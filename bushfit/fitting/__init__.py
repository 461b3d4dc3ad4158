"""Fits: residuals in units of noise, lmfit, uncertainty."""
