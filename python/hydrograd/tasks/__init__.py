"""Tasks: scenes with what it means to do well in them, shared by the examples and the environments of
`hydrograd.gym`.
"""
