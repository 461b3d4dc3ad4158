"""Simulated campaigns: the loops, sweeps and resonance tests that a rig would write for a known model."""
