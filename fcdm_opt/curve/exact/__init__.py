"""The exact decision curve of one pair of convex parts: rational arithmetic on the float inputs as they are.

    curve = exact_curve(one, two, transform)      # two ConvexPart, a 4x4 array taken as given
    curve.status, curve.chains, curve.proof       # chains of ExactPiece and ExactCorner, overlap on the left
    curve.side(rho), curve.separation(rho)        # which side of the curve a scale pair lies on, and how far off

Only the vertices are used: no hull, no normals, no kernels. The scale pairs at which two parts meet are the projective
image of a polygon, the shadow of a linear program's solutions; its edges in the open quadrant are the curve.

rationals   integers and rationals, to and from floats
program     the linear program of two parts: columns, pricing, bases, pivots, phase one
curve       the polygon of all scale pairs that meet, corner by corner, and what it comes to: pieces, corners, chains
"""

from fcdm_opt.curve.exact.curve import ExactChain, ExactCorner, ExactCurve, ExactPiece, exact_curve

__all__ = ["ExactChain", "ExactCorner", "ExactCurve", "ExactPiece", "exact_curve"]
