"""The decision curve of two bodies: which scale pairs touch, and by which features.

kernels          compiled: the walk over the two Gauss maps, which proves itself; all facet directions; what regions
                 leave of each other's boundaries
exact            the curve of one pair of convex parts in rational arithmetic
features         contact features and their labels
contact          the elements and points in which two scaled parts touch
region           one pair of convex parts: its overlap region and the chains that bound it, walked or settled exactly
pruning          the part pairs of unions that matter
envelope         the boundary of the union of all pairs' regions, joined to chains
segments         what a curve is listed as: segments, switching points, branches, inside a box
decision_curve   the curve as users see it, and its queries
batch            many poses of one pair at once, in arrays
touching_sizes   at which sizes of faces two bodies touch at a pose
games            compiled: matrix games, by which mixtures of rows prove bounds
flush            faces and edges that lie on one another, and what keeps them so
coherence        whether a claimed contact is the real one
"""
