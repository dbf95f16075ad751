"""Measurements of the toolkit against other ways to the same answer.

method       subjects, questions, answers, and a method at its own settings
timing       methods asked in turns
record       a run as a file; `comparing` tells how two of them differ
library      rivals' libraries, imported where they are installed
pairs        hulls by number of vertices, shape and separation, and questions about them; `union_pairs`
contacts     methods for one contact
curves       methods for the whole decision curve
motions      methods for the smallest motion, problems, and their least amounts
references   exact contacts and curves, how far answers are from them, faults of whole batches
cost         how time grows, and what the models of a scene take
chart        speed against accuracy: `fcdm-opt bench`
stability    where methods fail, each in a process of its own: `fcdm-opt stability`
"""
