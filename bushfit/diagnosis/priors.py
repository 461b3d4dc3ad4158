"""Constants that move a verdict: prior probabilities, sizes of effects and rig errors, and limits of each verdict."""

import numpy as np

#: Prior odds of each kind of explanation against "nothing is missing": expected number of such causes in a campaign.
#: Causes are independent, so the odds of several multiply, and nothing is missing with the probability e^-0.5 = 0.61
#: (Poisson). For most other campaigns the library has the missing effect.
ODDS = {"effect": 0.22, "part": 0.15, "record": 0.03, "unnamed": 0.10}
#: Sizes of missing effects and faults, relative to |K|, of equal prior probability: from invisible to several times |K|
#: (a stop). They are the widths of normal distributions, whose mean is log-uniform within 4 %.
SIZES = np.geomspace(0.004, 4.0, 7)
#: Sizes of errors of the rig in units of its class, with their prior weights: errors that a run shares, ...
RUNS = ((0.15, 0.2), (0.5, 0.3), (1.0, 0.25), (2.0, 0.2), (4.0, 0.05))
#: ... errors that all runs of a level share, and errors of each loop, ...
LEVELS = ((0.0, 0.35), (0.4, 0.3), (1.0, 0.25), (2.5, 0.1))
#: ... and slow drift along a run: at most the class, which is stated for errors that a run shares.
WANDERING = ((0.0, 0.6), (0.5, 0.25), (1.0, 0.15))
#: Size of level errors, in units of the class, above which they are a separate explanation.
WITHIN_CLASS = 1.5
#: Sizes of the compound's own deviation from the model's laws, relative to |K|, with their weights: a compound that
#: obeys a few parameters within noise, or one that departs by one to three per cent, as most do, or by more, in steps
#: of a factor of two: the kinetics of a filler network that breaks and heals are in none of the laws.
COMPOUND = ((0.0, 0.5), (0.01, 0.15), (0.02, 0.15), (0.04, 0.1), (0.08, 0.06), (0.16, 0.04))
#: Number of harmonics of the drift along a run; the variance of harmonic j falls as 1/j^2.
WAVES = 4
#: Natural log of the odds below the best at which a state of the search is abandoned.
LOG_ODDS_CUTOFF = 12.0
#: Number of states of the search that are kept, in the first round and later; and number of rounds.
BEAM, ROUNDS = (4, 3), 3
#: Numbers of effects that are refitted, by highest linear evidence and by largest decrease of chi-square: in the first
#: round, later, and in the first round if the gap is too large for a linear model.
REFITS = ((4, 3), (2, 2), (8, 12))
#: Least probability that nothing is missing for the verdict `consistent`.
NOTHING = 0.15
#: Least probability of an explanation, or of a set of explanations, that is reported; and largest size of the set.
NAMED, MOST_REPORTED = 0.97, 4
#: Difference of chi-square between two explanations at which the better one has the probability `NAMED`.
DECISIVE_CHI_SQUARE = 2.0 * float(np.log(NAMED / (1.0 - NAMED)))
#: Least share of a gap, by change of |K|, that named effects explain next to a curve without a name: `partly`.
LEAST_NAMED_SHARE = 0.9
#: Probability of a misfit as large as that of the best explanation, below which the explanation does not fit.
DOES_NOT_FIT = 0.002
#: Largest held-out root mean square residual, in units of noise, of a closed gap: noise alone gives 1.1.
LARGEST_CLOSED_GAP = 1.2
#: Largest excess of the held-out residuals over noise with a smooth correction whose error is larger than the gap,
#: relative to the excess without it.
LARGEST_REMAINING_SHARE = 0.5
