"""The smallest motion as a function of the actual sizes, over a whole tolerance box.

compensation_map the map, and how it is asked for: start reading here
sampling         least motions at single pairs of sizes, and what holds them: it tells the regions apart
size_mesh        triangles over the box, and how they are split where, along a line, one active set gives way to another
refined_mesh     the same, refined until the motion is known everywhere
table            triangles that interpolate it, for programs on the shop floor
assembly_yield   the share of part pairs whose motion stays within a budget, and which size it hangs on
"""
