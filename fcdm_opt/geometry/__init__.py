"""Bodies, and the Euclidean queries on them.

files            meshes as files have them, in a unit; `flattening` undoes what single precision bent
mesh             a closed surface, checked and repaired where that is certain: `closing`, `crossings`
arrays           array types and checks
measures         vectors; volume, centroid and winding numbers of triangles
polygons         planar polygons: their sides, cut by planes, what they hold, in one plane, in triangles
hull             face loops and edges of one convex part
elements         the body's own vertices, edges and faces, for labels
surface          the true faces and edges of a solid, and what lies on them
union            the true faces and edges of a union of convex parts
cells            convex cells cut by planes: sides in floats, points in rationals
partition        a solid cut into convex cells at its reflex edges, or covered by parts that all hold the seed
pyramids         the surface of a solid alone: a convex part under each face
decomposition    which of these, or CoACD's convex parts, with bounds of how far they are off, and why
packing          a convex part as flat arrays for the kernels, with error bounds
bodies           convex parts, and bodies made of them or of what other libraries hold
facets           which facets of two bodies are near each other
collision        signed distance by a collision library, confirmed by explicit vertices: `judging`
units            lengths and bounds in words
"""
