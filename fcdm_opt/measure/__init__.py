"""Measurements of the toolkit against other ways to the same answer.

pairs            hulls by number of vertices, shape and separation, and questions about their contacts and curves
curves           the whole decision curve of a convex pair: our ways to it, and rivals'
curve_rivals     bisection, distances, linear programs and growth distances that lead to the curve
rays             where rays of the scale plane meet it, by single growth distances
references       exact contacts and curves, how far answers are from them, faults of whole batches
motions          the smallest motion by searches that know nothing of how the problem is built
"""
