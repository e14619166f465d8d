"""The command `infoset` as ``python -m infoset``."""

import runpy

if __name__ == "__main__":
    # By name: the command line is in `experiments`, a layer that no module of `infoset` imports.
    runpy.run_module("experiments", run_name="__main__", alter_sys=True)
