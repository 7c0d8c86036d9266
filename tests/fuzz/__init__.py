"""Input from strangers: every parser gets what nobody means to send, and gives a result or one named error.

Each input is made from a target's name and a number alone, so that it can be made again:
`python -m tests.fuzz --replay TARGET:NUMBER`.
"""
