"""Speed against accuracy: `fcdm-opt bench`.

bench       the tasks, their scenes and plans, and what a run finds
figures     time on one axis, error on the other
results     the files that a run writes
"""
