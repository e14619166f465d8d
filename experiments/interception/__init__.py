"""The interception of an asteroid: scenario and record files, commands, figures, page and printed
numbers.
"""
