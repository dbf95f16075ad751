"""What is asked, and what is answered: plain data, and the files that hold it.

schema, files    problem files (TOML) and plain data
amounts          what is made least; `arguments` checks what a problem is made of
keep_out         further bodies to keep clear of
problem          the question, checked, every default resolved
fit              how the parts as drawn fit into each other
evidence         what a proof rests on; `sensitivities`, how the amount changes with the data
solution         what a solve returns: status, certificate and all claims
"""
