"""What a study answers: columns, the trade-off, tables and pictures."""
