"""The decision curve of two bodies: which scale pairs touch, and by which features.

kernels          all compiled kernels: the walk over the two Gauss maps, which proves itself; all facet directions
exact            the curve of one pair of convex parts in rational arithmetic, with proofs
features         contact features and their labels
contact          the elements and points in which two scaled parts touch
region           one pair of convex parts: its overlap region and the chains that bound it, walked or settled exactly
envelope         the boundary of the union of all pairs' regions
segments         what a curve is listed as: segments, switching points, branches, inside a box
decision_curve   the curve as users see it, and its queries
batch            many poses of one pair at once, in arrays
coherence        whether a claimed contact is the real one
"""
