"""The smallest motion as a function of the actual sizes, over a whole tolerance box.

compensation_map the map, and how it is asked for: start reading here
building         triangles over the box, refined until the motion is known everywhere
crossing         where, along a line, one way of holding the motion gives way to another
nodes            least motions at single pairs of sizes, and what holds them
table            triangles that interpolate it, for programs on the shop floor
lookup           compiled: which triangle a size pair is in, and the value there
assembly_yield   the share of part pairs whose motion stays within a budget
histogram        how many amounts there are of each size, in bounded memory
indices          which share of the amount's variance is due to which size
"""
