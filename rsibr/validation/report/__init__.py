"""Report of a validation: page, tables, images."""
