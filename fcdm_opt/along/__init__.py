"""How far a motion holds, and how its amount changes.

coherent_range   the interval of a ray in which the tracked contact stays one, and the events that end it
contact_times    when a scale pair is apart, touches and overlaps on a ray
march            safe steps to the next zero of a condition, of the tracked contact or of other part pairs
followed         conditions of the tracked contact
conditions       all of them as functions of x, in `expansions` or in balls of any precision
sensitivity      how the least amount changes with the data: from the constraints that hold a motion (`holding`)
variation        how a contact changes with scales, seeds, vertices and face planes
"""
