"""Questions beside a question: what changes when something else does.

whatif        a changed question solved again, beside what first derivatives predict
budget        the largest tolerance such that it and all smaller ones can be made good
fitting       how much of the deviation can be made good, and where that needs no scan
compare       which family of motions is cheapest
constraints   the constraints of a question, one by one; `drop`, what each of them costs
conflicts     which of them exclude each other, and what would cure it
search        the clashes and the least relaxations, looked for
"""
