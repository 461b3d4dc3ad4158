"""The bushing of the paper and the parameters of its Table 1, as values and as a campaign states them."""

from bushfit.geometry import Bushing

TABLE_1 = {"mu": 1.09e6, "m": 2.0e5, "alpha": 0.24, "sigma_fmax": 1.46e4, "eps_half": 1.3e-2}
CMP_15961 = Bushing("CMP 15 961", 0.010, 0.018, 0.034)
BUSHING = '[bushing]\nname = "B"\ninner_radius = "10 mm"\nouter_radius = "18 mm"\nlength = "34 mm"\n'
PARAMETERS = """
[simulate.parameters]
mu = "1.09 MPa"
m = "0.2 MPa*s^alpha"
alpha = 0.24
sigma_fmax = "14.6 kPa"
eps_half = 0.013
"""
