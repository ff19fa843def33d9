"""The command line that the present command was called with, for messages that say how to go on."""

from collections.abc import Collection

import click
from click.core import ParameterSource


def typed_command(without: Collection[str] = ()) -> str:
    """The present command line; parameters ``without`` are omitted."""
    import shlex

    context = click.get_current_context()
    words = ["msahl", str(context.info_name)]
    for parameter in context.command.params:
        name = str(parameter.name)
        given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if not given or name in without:
            continue
        value = context.params[name]
        for one in value if parameter.multiple else (value,):
            if isinstance(parameter, click.Option):
                words.append(max(parameter.opts, key=len))
            if not (isinstance(parameter, click.Option) and parameter.is_flag):
                words.append(str(one))
    return shlex.join(words)
