"""Design studies: what the answer becomes when the question changes.

distributions    what sizes and other numbers are drawn from
sizes            which sizes are spoken of: a box, a list, what distributions give
places           a place in plain tables, as studies and files name keys of a problem
question         a problem as plain tables: any key can be changed
study/           many questions at once, in a file or in Python
whatif/          questions beside a question: what changes, what clashes, what costs how much
compensation/    the smallest motion as a function of the actual sizes, and the yield it gives
contact_gaps     gaps of contacts as drawn, affine in the sizes
stack/           which sizes a gap depends on, and how much
fixed_pose/      one pose for all pairs of parts, and their clearances there
"""
