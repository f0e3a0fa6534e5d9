"""``rivid completion``."""

import click

PLACES = {
    "bash": (
        "#   ~/.local/share/bash-completion/completions/rivid",
        '# or add to ~/.bashrc: eval "$(rivid completion bash)"',
    ),
    "zsh": (
        "#   _rivid in a directory of $fpath",
        '# or add to ~/.zshrc, after compinit: eval "$(rivid completion zsh)"',
    ),
    "fish": ("#   ~/.config/fish/completions/rivid.fish",),
}
"""Location of each shell's script."""


@click.command("completion")
@click.argument("shell", type=click.Choice(list(PLACES)))
def command(shell: str) -> int:
    """Print the script that completes commands, options and their values with Tab.

    Its first lines name the file to save it as, which the shell reads when it starts.

    \b
    Examples:
      rivid completion bash > rivid-completion.bash
      rivid completion zsh > _rivid
      rivid completion fish > rivid.fish
    """
    from click.shell_completion import ShellComplete, get_completion_class

    from rivid.cli import cli

    kind = get_completion_class(shell)
    assert kind is not None
    # not kind.source: for bash it runs the bash of PATH to check its version, with a warning on stderr
    script = ShellComplete.source(kind(cli, {}, "rivid", "_RIVID_COMPLETE")).strip()
    lines = script.splitlines()
    head = [lines.pop(0)] if lines[0].startswith("#compdef") else []  # zsh needs it first
    click.echo("\n".join([*head, f"# Completion of rivid for {shell}. Save it as", *PLACES[shell], *lines]))
    return 0
