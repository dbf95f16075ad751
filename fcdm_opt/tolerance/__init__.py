"""The tolerance problem: from a problem file to a verified smallest motion.

Read `solver` first; it names every stage. In the order of the data:

schema, files    problem files (TOML) and plain data
amounts          what is made least; `arguments` checks what a problem is made of
keep_out         further bodies to keep clear of
problem          the question, checked, every default resolved
task             the question in the solver's terms, and the answer every stage gives
equations        the contact equations, symbolic in the motion parameters
bounds           lower bounds that hold whatever the solver did
stages/          how motions are found, least effort first
proof/           branch and bound: how small a motion can be at all; evidence that is checked apart
ranges/          over which stretch of a motion the tracked contact stays, and when bodies touch
sensitivities/   how the least amount changes with the data
evidence         what a proof rests on, as plain data
solution         what a solve returns
claim            one claimed contact under examination, for the judge
certificate      the judge
"""
