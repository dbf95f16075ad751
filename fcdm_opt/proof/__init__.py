"""How small a motion can be at all: branch and bound over cells of motions.

enclosure        numbers over a cell: their linear part, and a bound of the rest
least_distance   compiled: least distance programs, the nearest points of two hulls
cells            compiled tests of cells
exclusion        why no motion of a cell will do
columns          the search: columns of directions, whose fronts advance by cells
checker          the independent check of what a proof rests on: `conditions` in the pose, bounded over cells by
                 their slopes (`mean_value`) in interval arithmetic (`intervals`)
uniqueness       whether a motion that restores contacts is the only one, or none is smaller: for stages and judge
"""
