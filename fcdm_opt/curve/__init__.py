"""The decision curve of two bodies: which scale pairs touch, and by which features.

kernels          all compiled kernels: facet directions, the walk over the two Gauss maps
features         contact features and their labels
contact          the point in which two scaled parts touch
rationals        integers and rationals, to and from floats
program          the linear program of two parts: its columns, and their pricing
simplex          bases, pivots, phase one
shadow           the polygon of all scale pairs that meet, by the shadow vertex method
weights          which vertices carry a contact
proof            a verdict on a scale pair, and its check
exact            the curve of one pair of convex parts in rational arithmetic, with proofs
region           the overlap region of one pair of convex parts, and the chains that bound it
envelope         the boundary of the union of all pairs' regions
decision_curve   the curve as users see it: segments, switching points, queries
coherence        whether a claimed contact is the real one
"""
