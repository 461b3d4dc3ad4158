"""The discrepancy workflow: where do model and measurement disagree, what is missing, does adding it close the gap?"""
