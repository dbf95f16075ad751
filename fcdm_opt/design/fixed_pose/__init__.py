"""One pose for all pairs of parts, where they are not measured one by one.

clearances    range and distribution of the gap over all sizes, without any re-positioning
nearest_miss  by how much parts do not go together, and which faces block
best_pose     the pose whose worst gap is least, or the smallest motion that keeps all gaps in a window, with proof

scene         two bodies at a pose, scaled or with sizes by name: their rows, and the extremes of the gap over all sizes
worst         what is made small: how far the worst gap is off, of the bodies or of contacts as drawn
local_search  a pose that is as good as those about it
cells         what is known of all poses of a cell, and branch and bound over cells
proof         the cells as evidence, and their independent checker
gaps          compiled: signed distances from rows, bounds over cells
"""
