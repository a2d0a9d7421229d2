"""`rsibr capture`: photographs, renders and paintings become environments; a file a subcommand."""
