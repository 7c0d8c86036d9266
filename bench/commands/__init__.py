"""One module a command: `arguments(parser)` says what it takes, `main(args)` does it and returns the exit status."""
