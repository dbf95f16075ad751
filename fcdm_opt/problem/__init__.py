"""What is asked, and what is answered: plain data, and the files that hold it.

schema           how tables and arguments are read, and what is said of wrong ones; `syntax`, of a text that is no TOML
keys             every key of a problem, declared once; `entries`, bodies and steps of a motion
amounts          what is made least; `arguments` checks single values; `keep_out`, bodies to keep clear of
problem          the question, checked, every default resolved; its file; `nominal`, the contact that it speaks of
reach            which parts of large bodies are modelled
fit              how the parts as drawn fit into each other
evidence         what a proof rests on
solution         what a solve returns: status, certificate, sensitivities and all claims
"""
