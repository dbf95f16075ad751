"""Measurements of the toolkit against other ways to the same answer.

rivals           the decision curve of a convex pair by bisection, by linear programs and by single growth distances
motions          the smallest motion by searches that know nothing of how the problem is built
"""
