"""What a validation writes: page, tables, pictures."""
