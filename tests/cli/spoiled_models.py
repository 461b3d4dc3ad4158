"""What is spoiled in a model file, how, and what the one error has to say."""

# fmt: off
from __future__ import annotations

import math

from damage import entry, without

nan = math.nan
#: (name, change of the model file, what the error says ...)
IN_MODEL = [
    ("another schema", entry("schema", value="bushfit/model/9"), "model.json, schema: not a model this version reads", "use a file written by bushfit fit-static, fit-dynamic, fit or diagnose"),
    ("no bushing", without("bushing"), "model.json, bushing: a key is missing", "bushing = ..."),
    ("bushing is a text", entry("bushing", value="CMP"), "model.json, bushing: this value is not understood", "a table"),
    ("bushing without length", without("bushing", "length_m"), "model.json, bushing.length_m: a key is missing", "length_m = ..."),
    ("length in millimetres as text", entry("bushing", "length_m", value="34 mm"), "model.json, bushing.length_m: this value is not understood", "a number"),
    ("negative length", entry("bushing", "length_m", value=-0.034), "model.json, length: impossible bushing", "a positive length"),
    ("radii swapped", entry("bushing", "inner_radius_m", value=0.02), "model.json, inner_radius, outer_radius: impossible bushing", "check that radii were given, not diameters, and that they are not swapped"),
    ("name is a number", entry("bushing", "name", value=3), "model.json, bushing.name: this value is not understood", "a text in quotes"),
    ("name of control characters", entry("bushing", "name", value="a\x1b[2Jb\n"), "model.json, bushing.name: this value is not understood", "found: a\\x1b[2Jb\\n", "one line without control characters"),
    ("name of half a character", entry("bushing", "name", value="a\ud800"), "model.json, bushing.name: this value is not understood", "found: a\\ud800", "text in Unicode"),
    ("name without end", entry("bushing", "name", value="x" * 5000), "model.json, bushing.name: this value is not understood", "at most 200 characters"),
    ("empty name", entry("bushing", "name", value=""), "model.json, bushing.name: this value is not understood", "a text that is not empty"),
    ("tests is a text", entry("fit", "tests", value="all"), "model.json, fit.tests: this value is not understood", "a list"),
    ("place of a test is missing", entry("fit", "usable", value=[{"stiffness": 0.1, "loss_factor": 0.1, "points": 9, "held_out": True}]), "model.json, fit.usable #1.place: a key is missing"),
    ("no effects", without("effects"), "model.json, effects: a key is missing", "effects = ..."),
    ("unknown effect", entry("effects", value=["elastic", "springpot", "friction", "inertai"]), "model.json: unknown effect", "did you mean inertia?"),
    ("effect twice", entry("effects", value=["elastic", "elastic", "springpot", "friction"]), "model.json: an effect is listed twice"),
    ("effect without its values", entry("effects", value=["elastic", "springpot", "friction", "inertia"]), "model.json, inertia.mass: a parameter has no value", "a number [kg]"),
    ("values of an effect that is not there", entry("effects", value=["elastic", "friction"]), "model.json, m: unknown parameter", "one of mu, sigma_fmax, eps_half"),
    ("no parameters", without("parameters"), "model.json, parameters: a key is missing", "parameters = ..."),
    ("parameter is missing", without("parameters", "mu"), "model.json, mu: a parameter has no value", "a number [Pa]"),
    ("parameter without value", without("parameters", "mu", "value"), "model.json, parameters.mu.value: a key is missing", "value = ..."),
    ("value is NaN", entry("parameters", "mu", "value", value=nan), "model.json: this is not valid JSON", "give the file as bushfit fit wrote it"),
    ("value below zero", entry("parameters", "mu", "value", value=-1.0), "model.json, mu: impossible value", "0 to 1e+09 Pa (elastic shear modulus)"),
    ("alpha above one", entry("parameters", "alpha", "value", value=1.5), "model.json, alpha: impossible value", "0.02 to 1 (order of the fractional derivative)"),
    ("value of 400 digits", entry("parameters", "mu", "value", value=10**400), "model.json, parameters.mu.value: this value is not understood", "a number"),
    ("vary is a text", entry("parameters", "mu", "vary", value="yes"), "model.json, parameters.mu.vary: this value is not understood", "true or false"),
    ("unknown parameter", entry("parameters", "nu", value={"value": 0.5}), "model.json, nu: unknown parameter", "one of mu, m, alpha, sigma_fmax, eps_half"),
    ("at another bound", entry("parameters", "mu", "at_bound", value="middle"), "model.json, parameters.mu.at_bound: this value is not understood", "'min' or 'max'"),
    ("profile of one end", entry("parameters", "mu", "profile95", value=[1.0e6]), "model.json, parameters.mu.profile95 #2: a key is missing", "a further value"),
    ("covariance without matrix", without("covariance", "matrix"), "model.json, covariance.matrix: a key is missing", "matrix = ..."),
    ("covariance of another size", entry("covariance", "matrix", value=[[1.0, 2.0]]), "model.json, covariance: no covariance of its names", "1 x 1"),
    ("covariance of other names", entry("covariance", "names", value=["nu"]), "model.json, covariance: the covariance does not belong to the parameters"),
    ("variance below zero", entry("covariance", "matrix", value=[[-1.0]]), "model.json, covariance.matrix: a variance below zero", "squares on the diagonal"),
    ("fit without noise", without("fit", "noise"), "model.json, fit.noise: a key is missing", "noise = ..."),
    ("range of strains alone", without("fit", "frequency_Hz"), "model.json, fit.frequency_Hz: a key is missing", "frequency_Hz = ..."),
    ("row of an outlier in quotes", entry("outliers", value=[{"test": "a", "file": None, "row": "7", "column": "force", "distance": 9}]), "model.json, outliers #1.row: this value is not understood", "a whole number"),
    ("outliers without distance", entry("outliers", value=[{"test": "a", "file": None, "row": 7, "column": "force"}]), "model.json, outliers #1.distance: a key is missing", "distance = ..."),
    ("inputs without checksum", entry("provenance", "inputs", value=[{"file": "a.csv"}]), "model.json, provenance.inputs #1.sha256: a key is missing", "sha256 = ..."),
    *((f"outer radius of {size:g}", entry("bushing", "outer_radius_m", value=size), "model.json, ", "impossible bushing") for size in (1e50, 1e-300, 1e4)),
    ("outer radius of 1e300", entry("bushing", "outer_radius_m", value=1e300), "model.json, bushing.outer_radius_m: this value is not understood", "less than or equal to 1e+100"),
    ("length of 1e30", entry("bushing", "length_m", value=1e30), "model.json, length: impossible bushing", "1e-06 to 100 m"),
    ("a strain that falls", entry("fit", "strain", value=[1, 0]), "model.json, fit.strain: this is no range", "found: 1, 0"),
    ("a strain of zero", entry("fit", "strain", value=[0, 1]), "model.json, fit.strain: this is no range", "least and largest, above zero"),
    ("frequencies that fall", entry("fit", "frequency_Hz", value=[9, 1]), "model.json, fit.frequency_Hz: this is no range"),
    ("negative noise", entry("fit", "noise", value=-1), "model.json, fit.noise: no fit has this", "zero or more"),
    ("a covariance of no quantities", entry("covariance", value={"names": ["mu", "m"], "matrix": [[1e6, 1e9], [1e9, 1e6]]}), "model.json, covariance.matrix: a covariance that no quantities have", "a positive semidefinite matrix"),
    ("a covariance with nothing beside it", entry("covariance", value={"names": ["mu", "m"], "matrix": [[0, 1], [1, 1]]}), "model.json, covariance.matrix: a covariance that no quantities have"),
    ("a covariance that is not symmetric", entry("covariance", value={"names": ["mu", "m"], "matrix": [[1e6, 5e5], [-5e5, 1e6]]}), "model.json, covariance.matrix: a covariance that is not symmetric"),
    ("a parameter twice", entry("covariance", value={"names": ["mu", "mu"], "matrix": [[1e6, 0], [0, 1e6]]}), "model.json, covariance.names: a parameter twice"),
    ("a variance of 1e300", entry("covariance", "matrix", value=[[1e300]]), "model.json, covariance.matrix #1 #1: this value is not understood"),
    ("a spread of 1e300", entry("covariance", "spread", value=[[[1e300]]]), "model.json, covariance.spread #1 #1 #1: this value is not understood"),
    ("100 000 warnings", entry("warnings", value=["w"] * 100_000), "model.json, warnings: this value is not understood", "at most 10000 items"),
    ("a warning of 5 MB", entry("warnings", value=["w" * 5_000_000]), "model.json, warnings #1: this value is not understood", "at most 10000 characters"),
]
#: The same for predict alone: a compound without a body still holds the other parameters of a fit.
IN_PREDICTED = [
    ("no bushing and no specimen", entry("bushing", value=None), "there is no bushing", "bushfit predict MODEL.json --bushing other.toml"),
]
#: (name, content of the model file, what the error says ...)
WHOLE_MODELS = [
    ("no model", None, "model.json: there is no such file", "check the path for a typing error"),
    ("empty model", "", "model.json: the file is empty", "export it again"),
    ("model is a list", "[]", "model.json: not a model", "a JSON object { ... }"),
    ("a key twice", '{"schema": "bushfit/model/1", "schema": "bushfit/model/1"}', "model.json: this is not valid JSON", "give the file as bushfit fit wrote it"),
    ("deep lists in JSON", "[" * 100_000, "model.json: this is not valid JSON", "give the file as bushfit fit wrote it"),
    ("an integer of many digits", '{"schema": ' + "9" * 5000 + "}", "model.json: this is not valid JSON", "give the file as bushfit fit wrote it"),
    ("a binary model", b"PK\x03\x04\0\0", "model.json, line 1: the file is not UTF-8 text", "save it as UTF-8, or convert it: iconv -f LATIN1 -t UTF-8 old > new"),
    ("a model of 10 MB", " " * 10_000_001 + "{}", "model.json: the file is too large", "bushfit fit writes a model.json"),
]
