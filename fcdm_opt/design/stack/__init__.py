"""Which sizes a gap depends on, how much, and which tolerances are cheapest.

stack_up  how it is asked for: start reading here
loops     rows of an assembly: the gap of two parts in the sizes of all
"""
