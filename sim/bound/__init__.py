"""The lower bound of the miss: two true motions with the same measurements that no strategy can
tell apart in time.
"""
