"""Along a ray of motions: how far the tracked contact stays one, and when the bodies touch.

coherent_range   the interval, and the events that end it
contact_times    when a scale pair is apart, touches and overlaps
march            safe steps to the next zero of a condition
followed, others conditions of the tracked contact, and of all other part pairs
expansions       conditions as functions of the parameter (`expanding`, compiled; `operations`, of the motion)
"""
