"""Everything that leaves the program: tables, meshes, pictures, the report."""
