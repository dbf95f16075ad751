"""The same for programs: a problem in the solver's terms, and the equations of its contacts.

task             the question in the solver's terms, and the answer every stage gives
equations        the contact equations, symbolic in the motion parameters
seats            flush contacts that stay flush
bounds           lower bounds that hold whatever the solver did
"""
