"""Bodies, and the Euclidean queries on them.

arrays           array types and checks
corners          corners of a hull that are none, within rounding
hull             face loops and edges of one convex part
elements         the body's own vertices, edges and faces, for labels
packing          a convex part as flat arrays for the kernels, with error bounds
bodies           convex parts, and bodies made of them
collision        signed distance by a collision library, confirmed by explicit vertices
"""
