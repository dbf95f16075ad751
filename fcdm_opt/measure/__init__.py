"""Measurements of the toolkit against other ways to the same answer.

What is measured, and how
    method       subjects, questions, answers, and a method at its own settings
    timing       methods asked in turns
    record       a run as a file; `comparing` tells how two of them differ
    bench        speed against accuracy on three tasks; `results`, `charts` write and draw it

One contact, and the whole curve
    pairs        hulls by number of vertices, shape and separation, and questions about them
    union_pairs  bodies of many parts
    contacts     one contact: our ways to it, and rivals'
    curves       the whole decision curve of a convex pair: our ways to it, and rivals'
    library      rivals' libraries, imported where they are installed
    curve_rivals bisection, distances, linear programs and growth distances that lead to the curve
    rays         where rays of the scale plane meet it, by single growth distances
    references   exact contacts and curves, how far answers are from them, faults of whole batches

The smallest motion
    motions      our solver, and searches that know nothing of how the problem is built
    asked        what a problem asks, as numbers for them
    motion_cases problems drawn at random
    least        their least amounts, proved; `held` says what holds a motion, `jets` are the numbers

What it costs
    growth       time by vertices, parts and parameters; `growth_picture`
    models       size and time of each stage's program, in `model_scenes`; `models_picture`

Where methods fail
    stability    hard cases, each method in a process of its own
"""
