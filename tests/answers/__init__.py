"""Record of the program's answers, to compare bit for bit before and after a change that must not change any.

`python -m tests.answers record --out DIR` runs the public commands and stores what they answer;
`python -m tests.answers compare BEFORE AFTER` names each difference.
"""
