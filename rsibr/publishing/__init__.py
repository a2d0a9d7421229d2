"""Publishing: files and pages for other programs, a format a file."""
