"""Sizes that no bushing has, and statistics that no fit has: what is spoiled, how, and what the one error has to say."""

# fmt: off
from __future__ import annotations

from damage import column, entry, every, row

#: (what is done to the model file, how, what the error says ...)
IN_MODEL = [
    *((f"outer radius of {size:g}", entry("bushing", "outer_radius_m", value=size), "model.json, ", "impossible bushing") for size in (1e50, 1e-300, 1e4)),
    ("outer radius of 1e300", entry("bushing", "outer_radius_m", value=1e300), "model.json, bushing.outer_radius_m: this value is not understood", "less than or equal to 1e+100"),
    ("length of 1e30", entry("bushing", "length_m", value=1e30), "model.json, length: impossible bushing", "1e-06 to 100 m"),
    ("a strain that falls", entry("fit", "strain", value=[1, 0]), "model.json, fit.strain: this is no range", "found: 1, 0"),
    ("a strain of zero", entry("fit", "strain", value=[0, 1]), "model.json, fit.strain: this is no range", "least and largest, above zero"),
    ("frequencies that fall", entry("fit", "frequency_Hz", value=[9, 1]), "model.json, fit.frequency_Hz: this is no range"),
    ("frequencies of 1e-300", entry("fit", "frequency_Hz", value=[1e-300, 9]), "model.json, fit.frequency_Hz: this is no range"),
    ("negative noise", entry("fit", "noise", value=-1), "model.json, fit.noise: no fit has this", "zero or more"),
    ("misfit of 1e300", entry("fit", "nrmse", value=1e300), "model.json, fit.nrmse: this value is not understood", "less than or equal to 1e+100"),
    ("a covariance of no quantities", entry("covariance", value={"names": ["mu", "m"], "matrix": [[1e6, 1e9], [1e9, 1e6]]}), "model.json, covariance.matrix: a covariance that no quantities have", "a positive semidefinite matrix"),
    ("a covariance with nothing beside it", entry("covariance", value={"names": ["mu", "m"], "matrix": [[0, 1], [1, 1]]}), "model.json, covariance.matrix: a covariance that no quantities have"),
    ("a covariance that is not symmetric", entry("covariance", value={"names": ["mu", "m"], "matrix": [[1e6, 5e5], [-5e5, 1e6]]}), "model.json, covariance.matrix: a covariance that is not symmetric"),
    ("a parameter twice", entry("covariance", value={"names": ["mu", "mu"], "matrix": [[1e6, 0], [0, 1e6]]}), "model.json, covariance.names: a parameter twice"),
    ("a variance of 1e300", entry("covariance", "matrix", value=[[1e300]]), "model.json, covariance.matrix #1 #1: this value is not understood"),
    ("a spread of 1e300", entry("covariance", "spread", value=[[[1e300]]]), "model.json, covariance.spread #1 #1 #1: this value is not understood"),
    ("100 000 warnings", entry("warnings", value=["w"] * 100_000), "model.json, warnings: this value is not understood", "at most 10000 items"),
    ("a warning of 5 MB", entry("warnings", value=["w" * 5_000_000]), "model.json, warnings #1: this value is not understood", "at most 10000 characters"),
    ("a test of a name of 5 MB", entry("outliers", value=[{"test": "a" * 5_000_000, "file": None, "row": 7, "column": "force", "distance": 9}]), "model.json, outliers #1.test: this value is not understood", "at most 10000 characters"),
]
#: (text of the campaign, text instead of it, what the error says ...)
IN_CAMPAIGN = [
    *(('"10 mm"', f'"{size} mm"', "campaign.toml, bushing.inner_radius: no bushing has this", "a length from 1e-10 to 100 m") for size in ("1e-300", "1e300", "1e200")),
    ('"34 mm"', '"1 km"', "campaign.toml, bushing.length: no bushing has this", "found: 1000 m"),
    ('"34 mm"', '"1 nm"', "campaign.toml, length: impossible bushing", "1e-06 to 100 m"),
    ('"loop.csv"', '"loop.csv"\nrate = "1e300 mm/s"', "campaign.toml, loops #1.rate: no bushing has this"),
    ('"sweep.csv"', '"sweep.csv"\nat_amplitude = "1e-300 mm"', "campaign.toml, sweep.csv: no bushing has this"),
    ('"sweep.csv"', '"sweep.csv"\nat_frequency = "1e300 Hz"', "campaign.toml, sweeps #1.at_frequency: no bushing has this"),
]
#: The same for keys that the plain campaign does not use.
IN_MORE = [
    ('value = "1.1 MPa"', 'value = "1e300 MPa"', "more.toml, fit.mu.value: no bushing has this", "a stress from 1e-15 to 1e+15 Pa"),
    ('\namplitudes = ["0.1 mm"]', '\namplitudes = ["1e-300 mm"]', "more.toml, predict.amplitudes #1: no bushing has this"),
    ('amplitude = "1 mm"', 'amplitude = "1e300 mm"', "more.toml, simulate.loops #1.amplitude: no bushing has this"),
    ('frequency = "0.1 Hz"', 'frequency = "1e-300 Hz"', "more.toml, simulate.loops #1.frequency: no bushing has this"),
    ("eps_half = 0.013", "eps_half = 1e-300", "more.toml, simulate.parameters.eps_half: no bushing has this"),
]
#: (what is done to the lines of the loop, how, what the error says ...)
IN_LOOP = [
    ("displacements of 1e300", column(1, "1e300"), 'loop.csv, line 2, column "displacement [mm]": this is no finite number, or one beyond every rig'),
    ("displacements of 1e-300", lambda lines: "\n".join([lines[0], *(f"{cells[0]},{cells[1]}e-300,{cells[2]}" for cells in (line.split(",") for line in lines[1:]))]), 'loop.csv, column "displacement [mm]": the displacement never changes'),
    ("a time of 1e-300", lambda lines: "\n".join([lines[0], *(f"{number}e-300,{line.partition(',')[2]}" for number, line in enumerate(lines[1:]))]), 'loop.csv, column "time [s]": the record takes no time'),
    ("zeros far behind the head", lambda lines: ("\n".join(lines) + "\n").encode() * 40 + bytes(5), "loop.csv, line ", "this is not text", "found: byte 0x00"),
    ("zeros in a file of Latin letters", lambda lines: ("\n".join(lines) + "\n\xe4\n").encode("latin-1") * 40 + b"1,2\x00,3\n", "loop.csv, line ", "this is not text", "found: byte 0x00"),
    ("a header that clears the screen", every("force [N]", "for\x1b[2Jce\u202e [N]"), "loop.csv, line 1: there is no column for the force", "for\\x1b[2Jce\\u202e [N]"),
]
#: The same of the sweep.
IN_SWEEP = [
    *((f"{what} of {size}", column(place, size), "sweep.csv, line 2, column ") for place, what in enumerate(("frequencies", "amplitudes", "stiffnesses")) for size in ("1e-300", "1e300")),
    ("a frequency of 1e-300", row(2, "5,", "1e-300,"), 'sweep.csv, line 2, column "frequency [Hz]": no rig records so little', 'found: "1e-300"'),
]
#: (a limit, what the error says ...)
LIMITS = [
    *((f"{key} = {value}", f"judge.toml, {key}: this value is not understood", "found: ") for key in ("nrmse", "reduced_chi_square") for value in ("nan", "-0.1", "inf")),
    ('nrmse = "-1 %"', "judge.toml, nrmse: this value is not understood", "greater than or equal to 0"),
    ('[[loss_factor]]\nat = "axial 15 Hz 0.1 mm"\nmax = nan', "judge.toml, loss_factor #1.max: this value is not understood"),
    ('[[stiffness]]\nat = "axial 15 Hz 0.1 mm"\nmin = "-5 N/mm"', "judge.toml, stiffness #1.min: this value is not understood"),
    ("[parameters.alpha]\nmax = nan", "judge.toml, parameters.alpha.max: this is no quantity"),
    ('[parameters.mu]\nsigma = inf', "judge.toml, parameters.mu.sigma: this value is not understood"),
]
#: (arguments parted by |, what the error says ...)
USAGE = [
    *((f"predict|model.json|--frequencies|{size} Hz", "--frequencies: no bushing has this") for size in ("1e-300", "1e300")),
    *((f"{command}|--amplitudes|{size}mm", "--amplitudes: no bushing has this", "a length from 1e-10 to 100 m") for command in ("predict|model.json", "compare|model.json|model.json", "plan|model.json") for size in ("1e-300", "1e300")),
    ("plan|model.json|--hours|nan", "Invalid value for '--hours': nan is no time in hours such as 8"),
    ("plan|model.json|--hours|1e-300", "--hours: no test fits into the hours"),
    ("init|loop.csv|--direction|axial|--inner-radius|1e-300 mm|--outer-radius|18 mm|--length|34 mm", "--inner-radius: no bushing has this"),
    ("reduce|shaker.csv|--mass|1e300 kg|--direction|axial", "--mass: no bushing has this"),
    ("fit|campaign.toml|lo\u202est", "Got unexpected extra argument (lo\\u202est)"),
    ("predict|lo\u202est.json", "lo\\u202est.json: there is no such file"),
]
