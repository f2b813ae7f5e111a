"""Normal contact and slip of the caps."""
