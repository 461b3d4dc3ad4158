"""Second springpot: a power of frequency beside that of the first, such as the steep rise towards glass."""

from bushfit.effects.springpot import modulus as modulus
from bushfit.effects.springpot import modulus_sensitivities as modulus_sensitivities
from bushfit.effects.springpot import stress as stress
from bushfit.effects.springpot import stress_sensitivities as stress_sensitivities
