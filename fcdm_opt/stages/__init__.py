"""How motions are found: each stage answers a task, or says that the task is not its own.

order            all stages in their order, and the rule that the first to settle a task answers it
contact_system   several contacts restored at once
linear           motions in which all that is asked is linear: contacts brought to the target pair; one translation
turns            translations with rotations about the seed (`turned_cells`)
descent          least distance steps over contact rows (`compiled`)
best_first       the least motion under linear conditions with alternatives
separating_directions  descent over the directions that may separate part pairs
forbidden_shifts what clearances forbid them
direction_search tracked contacts direction by direction
program          the nonlinear program; `relaxation` grows it by what its solutions violate, from several starts
rays             one parameter: first contact along a ray by safe steps (`steady`: of second order)
branching        branch and bound, see `proof`
full             everything in one program: the yardstick
after_weighted   other amounts than the weighted one; motions in whole steps of a machine
"""
