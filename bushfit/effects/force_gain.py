"""Force gain: the loop's force chain and the sweep's do not agree; loops are 1 + gain times what they should be."""

from bushfit.effects.contract import scaled_response

stiffness = force = scaled_response(lambda p, setting: 1.0 + p["gain"] if setting.kind == "loop" else 1.0)
