"""An attack on ordinary parts: oracles, scenes, verdicts; only `asking` and `mesh_files` know the package."""
