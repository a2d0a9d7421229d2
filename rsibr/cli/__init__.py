"""Command line: one file for each command, which parses options, calls the library, and prints the result."""
