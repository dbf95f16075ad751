"""An attack on ordinary parts (`run`): oracles, scenes and verdicts; only `asking` knows the package under attack."""
