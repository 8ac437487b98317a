"""The `walk` command: `cli` starts it, and `run_commands` has the subcommands about runs."""
