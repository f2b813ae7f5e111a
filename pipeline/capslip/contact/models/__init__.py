"""The contact models: each file here is one rung of the ladder, `RUNG`, under the file's name."""
