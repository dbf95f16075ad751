"""Design studies: what the answer becomes when the question changes.

distributions    what sizes and other numbers are drawn from
proportion       how well a share is known from a count
compensation/    the smallest motion as a function of the actual sizes, and the yield it gives
"""
