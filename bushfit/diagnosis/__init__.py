"""Diagnosis of a campaign: regions of disagreement, missing effects, and the gap after they are added."""
