"""Studies: many questions at once, in a file or in Python. Start reading at `running`.

running      run_study, the main path
study        Study: which points, and the question at each of them
variables    what varies: keys of a problem, and what they take
derivation   keys that follow from parameters, by expressions
sampling     grids and draws
schema       what a study file may hold
checking     what a study refuses before anything is solved
point        what a worker does: a point becomes a row
engines      joblib hands points out, here or to Dask
processes    where points are worked out; one that is lost costs its point
cluster      Dask as joblib's backend
store        the SQLite file of a study
results      what came out: tables, exports, yield
"""
