"""The theorem of the slip law against a direct solution under shear."""
