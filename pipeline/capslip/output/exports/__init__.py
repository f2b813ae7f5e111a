"""One export a file: the file's name is that of the export."""
