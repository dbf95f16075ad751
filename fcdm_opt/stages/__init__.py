"""How motions are found: each stage answers a task, or says that the task is not its own.

models           already met; one translation; one parameter; the nonlinear program
shift, seat      contacts brought to the target pair while nothing tilts
translations     several translations: best first over the ways apart
turns            translations with rotations about the seed (`turned_cells`)
descent          least distance steps over contact rows (`compiled`)
ways_apart       descent over all ways in which part pairs may come apart
direction_search tracked contacts direction by direction
program          the nonlinear program; `relaxation` grows it by what its solutions violate
rays             first contact along a ray by safe steps (`steady`: of second order)
branching        branch and bound, see `proof`
full             everything in one program: the yardstick
another_amount   other amounts than the weighted one
rounding         motions in whole steps of a machine
"""
