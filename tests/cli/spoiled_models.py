"""What is spoiled in a model file, how, and what the one error has to say."""

# fmt: off
import math

from damage import entry, without

nan = math.nan
NODES = {"frequency_Hz": [5.0], **{key: [0.01] for key in ("strain", "in_phase", "in_quadrature", "in_phase_error", "in_quadrature_error")}}
PATCH = {"directions": ["axial"], **NODES}
#: (name, change of the model file, what the error says ...)
IN_MODEL = [
    ("another schema", entry("schema", value="bushfit/model/9"), "model.json, schema: this version cannot read the file as a model", "use a file written by bushfit fit-static, fit-dynamic, fit or diagnose"),
    ("no bushing", without("bushing"), "model.json, bushing: a key is missing", "bushing = ..."),
    ("name is a number", entry("bushing", "name", value=3), "model.json, bushing.name: this value is not understood", "a text in quotes"),
    ("name of control characters", entry("bushing", "name", value="a\x1b[2Jb\n"), "model.json, bushing.name: this value is not understood", "found: a\\x1b[2Jb\\n", "one line without control characters"),
    ("name of half a character", entry("bushing", "name", value="a\ud800"), "model.json, bushing.name: this value is not understood", "found: a\\ud800", "text in Unicode"),
    ("name without end", entry("bushing", "name", value="x" * 5000), "model.json, bushing.name: this value is not understood", "at most 200 characters"),
    ("effect without its values", entry("effects", value=["elastic", "springpot", "friction", "inertia"]), "model.json, inertia.mass: a parameter has no value", "a number [kg]"),
    ("values of an effect that is not there", entry("effects", value=["elastic", "friction"]), "model.json, m: unknown parameter", "one of mu, sigma_fmax, eps_half"),
    ("a correction without its data", entry("effects", value=["elastic", "springpot", "friction", "unnamed"]), "model.json, unnamed: an effect without its data"),
    ("a correction of no size", entry("unnamed", value={"size": 0.0, "lengths": [1.0, 1.0], "patches": [PATCH]}), "model.json, unnamed.size", "expected: greater than 0"),
    ("a correction with a value too few", entry("unnamed", value={"size": 0.1, "lengths": [1.0, 1.0], "patches": [{**PATCH, "strain": []}]}), "model.json, unnamed", "lists of unequal length"),
    ("a correction at no strain", entry("unnamed", value={"size": 0.1, "lengths": [1.0, 1.0], "patches": [{**PATCH, "strain": [0.0]}]}), "model.json, unnamed.patches #1.strain #1", "expected: greater than 0"),
    ("parameter is missing", without("parameters", "mu"), "model.json, mu: a parameter has no value", "a number [Pa]"),
    ("value is NaN", entry("parameters", "mu", "value", value=nan), "model.json, parameters.mu.value: this value is not understood", "a finite number"),
    ("value below zero", entry("parameters", "mu", "value", value=-1.0), "model.json, mu: impossible value", "0 to 1e+09 Pa (static shear modulus)"),
    ("alpha above one", entry("parameters", "alpha", "value", value=1.5), "model.json, alpha: impossible value", "0.02 to 1 (exponent of the frequency dependence (order of the fractional derivative))"),
    ("vary is a text", entry("parameters", "mu", "vary", value="yes"), "model.json, parameters.mu.vary: this value is not understood", "true or false"),
    ("unknown parameter", entry("parameters", "nu", value={"value": 0.5}), "model.json, nu: unknown parameter", "one of mu, m, alpha, sigma_fmax, eps_half"),
    ("profile of one end", entry("parameters", "mu", "profile95", value=[1.0e6]), "model.json, parameters.mu.profile95 #2: a key is missing", "a further value"),
    ("covariance of another size", entry("covariance", "matrix", value=[[1.0, 2.0]]), "model.json, covariance: a covariance that does not match its names", "1 x 1"),
    ("covariance of other names", entry("covariance", "names", value=["nu"]), "model.json, covariance: the covariance does not belong to the parameters"),
    ("variance below zero", entry("covariance", "matrix", value=[[-1.0]]), "model.json, covariance.matrix: a variance below zero", "squares on the diagonal"),
    ("row of an outlier in quotes", entry("outliers", value=[{"test": "a", "file": None, "row": "7", "column": "force", "distance": 9}]), "model.json, outliers #1.row: this value is not understood", "a whole number"),
    *((f"outer radius of {size:g}", entry("bushing", "outer_radius_m", value=size), "model.json, ", "impossible bushing") for size in (1e50, 1e-300, 1e4)),
    ("outer radius of 1e300", entry("bushing", "outer_radius_m", value=1e300), "model.json, bushing.outer_radius_m: this value is not understood", "less than or equal to 1e+100"),
    ("a strain that falls", entry("fit", "strain", value=[1, 0]), "model.json, fit.strain: this range is not valid", "found: 1, 0"),
    ("negative noise", entry("fit", "noise", value=-1), "model.json, fit.noise: no fit has this", "zero or more"),
    ("a covariance of no quantities", entry("covariance", value={"names": ["mu", "m"], "matrix": [[1e6, 1e9], [1e9, 1e6]]}), "model.json, covariance.matrix: an impossible covariance", "a positive semidefinite matrix"),
    ("a covariance with nothing beside it", entry("covariance", value={"names": ["mu", "m"], "matrix": [[0, 1], [1, 1]]}), "model.json, covariance.matrix: an impossible covariance"),
    ("a covariance that is not symmetric", entry("covariance", value={"names": ["mu", "m"], "matrix": [[1e6, 5e5], [-5e5, 1e6]]}), "model.json, covariance.matrix: a covariance that is not symmetric"),
    ("a parameter twice", entry("covariance", value={"names": ["mu", "mu"], "matrix": [[1e6, 0], [0, 1e6]]}), "model.json, covariance.names: a parameter twice"),
    ("a spread of two names", entry("covariance", value={"names": ["mu"], "matrix": [[1e6]], "spread": [[[1, 2]]]}), "model.json, covariance", "a covariance that does not match its names", "1 x 1"),
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
    ("model is a list", "[]", "model.json: not a model", "a JSON object { ... }"),
    ("a key twice", '{"schema": "bushfit/model/1", "schema": "bushfit/model/1"}', "model.json: this is not valid JSON", "use the file unchanged, as bushfit fit wrote it"),
    ("an integer of many digits", '{"schema": ' + "9" * 5000 + "}", "model.json: this is not valid JSON", "use the file unchanged, as bushfit fit wrote it"),
    ("a model of 10 MB", " " * 10_000_001 + "{}", "model.json: the file is too large", "bushfit fit writes a model.json"),
]
