"""The command line, thin: read the design, walk the pipeline, say what came of it.

Results go to standard output, messages and progress to standard error; ``failures`` has the exit
codes. Heavy libraries are imported inside the verbs, so that help is there at once.
"""

from phexfab.cli.app import app, main

__all__ = ["app", "main"]
