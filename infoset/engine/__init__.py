"""The sections of an information set: their storage, the two passes of a step, replay and the
guaranteed miss.
"""
