"""The same for programs: a problem in the solver's terms, and the equations of its contacts.

task             the question in the solver's terms, lower bounds that hold whatever the solver did, and the answer
                 every stage gives
reported         such an answer in the user's terms
equations        the contact equations, symbolic in the motion parameters
contact_rows     the same for programs of the user's own
templates        CasADi functions that are built once and kept
seats            flush contacts that stay flush
"""
