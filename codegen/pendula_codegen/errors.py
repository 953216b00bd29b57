"""The one exception that the command line turns into a line on standard error and exit status 2."""


class GenerationError(Exception):
    """The request or the model is wrong; the message is one line that says what and where."""
