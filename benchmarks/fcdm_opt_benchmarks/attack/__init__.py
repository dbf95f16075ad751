"""An attack on ordinary parts (`run`): oracles, scenes and verdicts; only `asking` and
`mesh_files` know the package under attack.
"""
