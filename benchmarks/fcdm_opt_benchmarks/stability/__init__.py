"""Where methods fail: families of hard cases, asked of every method in a process of its own.

case             a case and what an answer to it is worth
contacts, bodies, programs, motions
                 the cases by question, with who is asked and what is right; `run` says what such a module exports
scenes           bodies and problems as plain data, for programs and motions
run              every case asked of every method; `process` and `worker` are the two ends of a method's own process
failures         what is not right, saved to be asked again
grid             a whole run and what it writes; `table` in words, `picture` drawn
"""
