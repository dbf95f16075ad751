"""What the machine can do.

motions          conventions: translation, rotation, screw, free motion, and sequences of them
own_motion       motions given as a matrix in CasADi
kinematics       their functions, compiled
"""
