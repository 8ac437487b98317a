"""The `walk` command: one module for each group of subcommands."""
