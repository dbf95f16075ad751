"""Is it true? Shares no equation and no kernel with what finds motions.

certificate      every check of a solution
claimed_contact  one claimed contact under examination
whole            what was not modelled: the surfaces of the bodies as drawn
sampled_sizes    what is said of many sizes, where parts are made anew
engagement       whether a motion leaves the fit in which the parts are drawn
"""
