"""The tolerance problem: from a problem file to a verified smallest motion."""
