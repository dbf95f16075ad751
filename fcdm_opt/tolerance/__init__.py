"""The tolerance problem: from a problem file to a verified smallest motion.

Read `solver` first; it names every stage. In the order of the data:

schema, files    problem files (TOML) and plain data
problem          the question, checked, every default resolved; `arguments` checks them
keep_out         further bodies to keep clear of
task             the question in the solver's terms, and the answer every stage gives
equations        the contact equations, symbolic in the motion parameters
program          the nonlinear program: rows that are instances of the equations
relaxation       programs that leave out what may not matter, and grow by what is violated
bounds, rays     lower bounds; first contact along a ray by safe steps
models           the stages, with `translations` and `shift`, exact where nothing turns; `seat` says what may turn
solution         what a solve returns
variation        how a contact changes with scales, seeds, vertices and face planes
holding          the constraints that hold a motion
sensitivity      how the least amount changes with the data
claim            one claimed contact under examination, for the judge
certificate      the judge
"""
