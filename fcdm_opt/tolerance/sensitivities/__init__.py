"""How the least amount changes with the data.

variation        how a contact changes with scales, seeds, vertices and face planes
holding          the constraints that hold a motion
sensitivity      multipliers, derivatives, and where there are none
"""
