"""A campaign: one bushing and its tests, as its TOML file names them."""
