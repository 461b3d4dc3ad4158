"""Constants that move a verdict: prior probabilities, sizes of effects and rig errors, and limits of each verdict."""

import numpy as np

#: Odds beforehand of each kind of explanation; what is left is for nothing. One bushing in two meets its model; a
#: library that was written from what bushings and rigs show holds what most others lack.
ODDS = {"effect": 0.22, "place": 0.15, "record": 0.03, "unnamed": 0.10}
#: Sizes of what may be missing, relative to |K|, each as likely: from what no test shows to what no one overlooks.
SIZES = np.geomspace(0.004, 0.4, 7)
#: What an effect that is refitted changes at the most, relative to |K|: some make a bushing several times as stiff.
LARGEST = 4.0
#: Sizes of errors of the rig in units of its class, with their weights: what a run shares, ...
RUNS = ((0.15, 0.2), (0.5, 0.3), (1.0, 0.25), (2.0, 0.2), (4.0, 0.05))
#: ... what all runs of a level share, and each loop by itself, ...
LEVELS = ((0.0, 0.35), (0.4, 0.3), (1.0, 0.25), (2.5, 0.1))
#: ... and what wanders slowly along a run: no more than the class, which is said of what a run shares.
WANDERING = ((0.0, 0.6), (0.5, 0.25), (1.0, 0.15))
#: Errors of levels, in units of the class, above which they are an explanation of their own.
WITHIN_CLASS = 1.5
#: Sizes of the compound's own deviation from the model's laws, relative to |K|, with their weights: a compound that
#: obeys a few parameters within noise, or one that departs by one to three per cent, as most do, or by more, in steps
#: of a factor of two: the kinetics of a filler network that breaks and heals are in none of the laws.
COMPOUND = ((0.0, 0.5), (0.01, 0.15), (0.02, 0.15), (0.04, 0.1), (0.08, 0.06), (0.16, 0.04))
#: Harmonics of what wanders along a run; their variance falls as 1/j^2.
WAVES = 4
#: Degrees of freedom of the scatter, from which on it counts as known.
KNOWN = 30
#: Logarithm of odds below which a state of the search or an explanation is not followed.
FAR = 12.0
#: States of the search that are kept, in the first round and later, and rounds.
BEAM, ROUNDS = (4, 3), 3
#: Refits of what has most evidence by a linear count, and of what takes most off chi-square: in the first round, later,
#: and in the first where the gap is so large that a linear count tells little.
REFITS = ((4, 3), (2, 2), (8, 12))
#: Probability of nothing, from which on a verdict is `consistent`.
NOTHING = 0.15
#: Probability from which on an explanation is named; a set that reaches it is reported, of so many at most.
NAMED, MOST_REPORTED = 0.97, 4
#: Difference of chi-square that makes such odds between two.
TELLS = 2.0 * float(np.log(NAMED / (1.0 - NAMED)))
#: Share of what is missing, by its change of |K|, that names make where they may stand beside the unnamed: `partly`.
MOSTLY = 0.9
#: Probability of what the leader leaves, below which it does not fit.
DOES_NOT_FIT = 0.002
#: Gap, held out, in units of noise, up to which a name closes it: noise alone makes 1.1.
MOST_LEFT = 1.2
