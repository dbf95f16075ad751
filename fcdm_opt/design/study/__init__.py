"""Studies: many questions at once, in a file or in Python. Start reading at `running`.

running      run_study, the main path; joblib hands points out, here or to Dask
study        Study: which points, the question at each of them, and what it refuses before anything is solved
variables    what varies: keys of a problem, and what they take; grids and draws; keys that follow from parameters
schema       what a study file may hold
point        what a worker does: a point becomes a row
processes    where points are worked out; one that is lost costs its point
cluster      Dask as joblib's backend
store        the SQLite file of a study
results      what came out: tables, exports, yield
"""
