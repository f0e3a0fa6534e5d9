"""Imported last of all in the process that workers are forked from.

What it has imported stays as it is: no worker looks through it for rubbish, and so none copies its pages.
"""

import gc

gc.freeze()
